"""Inputs kept from fuzzing: each decoder accepts them, or raises an exception that it declares."""

import contextlib
from pathlib import Path

import pytest

from fuzz.targets import TARGETS, Target
from onboard.security.security_services import NotTrusted

CORPUS = Path(__file__).parents[2] / "fuzz" / "corpus"


def test_every_target_has_a_corpus_and_every_corpus_a_target() -> None:
    assert {folder.name for folder in CORPUS.iterdir()} == set(TARGETS)


@pytest.mark.parametrize("name", TARGETS)
def test_the_corpus_raises_nothing_undeclared(name: str) -> None:
    inputs = [path.read_bytes() for path in sorted((CORPUS / name).iterdir())]
    assert inputs
    for data in inputs:
        TARGETS[name].feed(data)
        TARGETS[name].feed(data[: len(data) // 2])


@pytest.mark.parametrize("name", ["certificate", "implicit"])
def test_signed_messages_of_the_corpus_pass_all_checks_of_the_signature(name: str) -> None:
    """Otherwise the fuzzer starts from bytes that the first check refuses."""
    read = TARGETS["ieee1609dot2"].read
    with contextlib.suppress(NotTrusted):  # had before, where another test has fed it
        read((CORPUS / "ieee1609dot2" / name).read_bytes())
    with pytest.raises(NotTrusted) as refused:
        read((CORPUS / "ieee1609dot2" / name).read_bytes())
    assert refused.value.reason == "replay"


def test_an_exception_that_a_target_does_not_declare_is_raised() -> None:
    target = Target(dict[bytes, None]().__getitem__, declared=(ValueError,))
    with pytest.raises(KeyError):
        target.feed(b"")
