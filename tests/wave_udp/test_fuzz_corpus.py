"""Inputs that fuzzing found worth having: each decoder takes them, or refuses as it declares."""

from pathlib import Path

import pytest

from fuzz.targets import TARGETS, Target

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


def test_what_a_target_does_not_declare_comes_through():
    target = Target({}.__getitem__, declared=(ValueError,))
    with pytest.raises(KeyError):
        target.feed(b"")
