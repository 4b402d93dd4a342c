"""The beam search against all sequences of cases small enough to list every path."""

import itertools
from collections import defaultdict

import numpy as np
import pytest

from onboard.vision.beam_search import (
    MAX_LENGTH,
    MIN_CLASS,
    likeliest_sequences,
    sequence_probabilities,
)


def every_sequence(likely: np.ndarray) -> dict[tuple[int, ...], float]:
    """The probability of each sequence, by the definition: the sum over all paths."""
    _, columns, classes = likely.shape
    found: dict[tuple[int, ...], float] = defaultdict(float)
    for path in itertools.product(range(classes), repeat=columns):
        labels = tuple(label for label, _ in itertools.groupby(path) if label)
        found[labels] += float(likely[:, np.arange(columns), path].prod(axis=1).mean())
    return found


def views(seed: int, columns: int, classes: int, sharpness: float) -> np.ndarray:
    """Three views that differ a little."""
    rng = np.random.default_rng(seed)
    scores = sharpness * rng.standard_normal((1, columns, classes))
    scores = scores + 0.3 * sharpness * rng.standard_normal((3, columns, classes))
    likely = np.exp(scores)
    return np.asarray(likely / likely.sum(axis=2, keepdims=True))


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize(("columns", "classes"), [(1, 4), (4, 3), (5, 4), (7, 3)])
def test_the_likeliest_sequences_are_those_of_the_definition(
    seed: int, columns: int, classes: int
) -> None:
    likely = views(seed, columns, classes, sharpness=1.5)
    oracle = sorted(every_sequence(likely).items(), key=lambda item: -item[1])
    oracle = [(labels, p) for labels, p in oracle[:10] if p > 10 * MIN_CLASS]

    found = likeliest_sequences(likely, 10)[: len(oracle)]

    assert [labels for labels, _ in found] == [labels for labels, _ in oracle]
    assert [p for _, p in found] == pytest.approx([p for _, p in oracle])


@pytest.mark.parametrize("seed", range(5))
def test_the_probability_of_every_sequence_is_that_of_the_definition(seed: int) -> None:
    likely = views(seed, 5, 3, sharpness=1.0)
    oracle = every_sequence(likely)

    assert sequence_probabilities(list(oracle), likely) == pytest.approx(list(oracle.values()))
    assert sum(oracle.values()) == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(5))
def test_with_many_columns_and_classes_probabilities_are_exact_and_in_order(seed: int) -> None:
    scores = 0.7 * np.random.default_rng(seed).standard_normal((3, 40, 37))
    scores[..., 0] += 9.0
    scores[:, 3:38:5, [7 + seed, 20, 33]] += (14.0, 13.0, 12.0)
    likely = np.exp(scores) / np.exp(scores).sum(axis=2, keepdims=True)

    found = likeliest_sequences(likely, 30)
    probabilities = [p for _, p in found]

    assert len({labels for labels, _ in found}) == len(found) == 30
    assert probabilities == sorted(probabilities, reverse=True)
    assert probabilities == pytest.approx(
        sequence_probabilities([labels for labels, _ in found], likely).tolist()
    )


def test_a_certain_sequence_is_alone() -> None:
    likely = np.zeros((1, 4, 37))
    likely[0, np.arange(4), [5, 5, 0, 5]] = 1.0

    assert likeliest_sequences(likely, 30) == [((5, 5), 1.0)]


def test_blank_columns_are_the_empty_sequence() -> None:
    likely = np.zeros((2, 6, 37))
    likely[..., 0] = 1.0

    assert likeliest_sequences(likely, 30) == [((), 1.0)]


def test_sequences_are_cut_at_the_greatest_length() -> None:
    likely = np.full((1, 40, 37), 1e-9)
    likely[0, ::2, 0] = 1.0
    likely[0, 1::2, 7] = 0.9
    likely[0, 1::2, 0] = 0.1

    assert max(len(labels) for labels, _ in likeliest_sequences(likely, 30)) == MAX_LENGTH
