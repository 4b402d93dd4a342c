"""Inputs that fuzzing found worth having: each decoder takes them, or refuses as it declares."""

import contextlib
from pathlib import Path

import pytest

from fuzz.targets import TARGETS, Target
from onboard.security.security_services import NotTrusted

CORPUS = Path(__file__).parents[2] / "fuzz" / "corpus"


def test_every_target_has_a_corpus_and_no_corpus_is_an_orphan():
    assert {folder.name for folder in CORPUS.iterdir()} == set(TARGETS)


@pytest.mark.parametrize("name", TARGETS)
def test_the_corpus_raises_nothing_undeclared(name):
    inputs = [path.read_bytes() for path in sorted((CORPUS / name).iterdir())]
    assert inputs
    for data in inputs:
        TARGETS[name].feed(data)
        TARGETS[name].feed(data[: len(data) // 2])


def test_signed_messages_of_the_corpus_get_as_far_as_their_signature():
    """Else the fuzzer starts from bytes that are refused at the door."""
    read = TARGETS["ieee1609dot2"].read
    with contextlib.suppress(NotTrusted):  # had before, where another test has fed it
        read((CORPUS / "ieee1609dot2" / "certificate").read_bytes())
    with pytest.raises(NotTrusted) as refused:
        read((CORPUS / "ieee1609dot2" / "certificate").read_bytes())
    assert refused.value.reason == "replay"


def test_what_a_target_does_not_declare_comes_through():
    target = Target({}.__getitem__, declared=(ValueError,))
    with pytest.raises(KeyError):
        target.feed(b"")
