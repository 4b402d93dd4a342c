"""Algorithm 1 line by line, and the paper's two baselines behind the same interface."""

from collections.abc import Sequence

import numpy as np
import pytest

from onboard.mvs.selective_broadcasting import (
    SELECTIONS,
    Candidate,
    Estimates,
    Selected,
    algorithm_1,
    measurements_only,
    random_selection,
)
from onboard.mvs.settings import Selection
from onboard.tracking.evidence import Estimate, Evidence, Measurement, measurement_id
from onboard.tracking.fusion import fuse
from onboard.tracking.independent_set import independent
from onboard.tracking.slices import result_of

RNG = np.random.default_rng(0)


def measurement(car: int, observer: bytes, stamp_ms: int = 0) -> Measurement:
    return Measurement(measurement_id(observer, stamp_ms), np.array([100.0 * car, 0.0]), np.eye(2))


def candidate(car: int, observers: str, is_sensed: bool) -> Candidate:
    evidence = [measurement(car, observer.encode()) for observer in observers]
    return Candidate(evidence, len(evidence), is_sensed)


def estimate(evidence_of_cars: Sequence[Sequence[Evidence]]) -> Estimates:
    yield
    return list(fuse([independent(evidence) for evidence in evidence_of_cars], 1.0))


def cars_of(selected: list[Selected]) -> list[int]:
    places = [e.position_m if isinstance(e, Measurement) else e.state for _, e in selected]
    return [round(place[0] / 100) for place in places]


def test_more_than_one_me_makes_an_estimate_lines_5_and_6() -> None:
    ((_, selected),) = result_of(algorithm_1([candidate(1, "abc", True)], 10, estimate, RNG))

    assert isinstance(selected, Estimate)
    assert len(selected.provenance) == 3


def test_the_only_me_is_sent_as_it_is_lines_7_and_8() -> None:
    only = candidate(1, "a", True)

    assert result_of(algorithm_1([only], 10, estimate, RNG)) == [(0, only.evidence[0])]


def test_seen_cars_come_first_then_the_most_significant_lines_10_to_20() -> None:
    candidates = [
        candidate(1, "abc", False),
        candidate(2, "abcd", True),
        candidate(3, "a", False),
        candidate(4, "ab", True),
        candidate(5, "ab", False),
    ]

    assert cars_of(result_of(algorithm_1(candidates, 10, estimate, RNG))) == [4, 2, 3, 5, 1]
    assert cars_of(result_of(algorithm_1(candidates, 3, estimate, RNG))) == [4, 2, 3]
    assert result_of(algorithm_1(candidates, 0, estimate, RNG)) == []


def test_among_equally_significant_cars_the_one_sent_last_comes_last() -> None:
    evidence = [[measurement(car, b"a")] for car in range(3)]
    candidates = [
        Candidate(evidence[0], 1, is_sensed=True, sent_ms=900),
        Candidate(evidence[1], 1, is_sensed=True, sent_ms=700),
        Candidate(evidence[2], 1, is_sensed=True, sent_ms=800),
    ]

    assert cars_of(result_of(algorithm_1(candidates, 2, estimate, RNG))) == [1, 2]


def test_every_selection_names_its_candidate() -> None:
    candidates = [candidate(car, "ab", is_sensed=car == 1) for car in range(6)]

    for select in SELECTIONS.values():
        selected = result_of(select(candidates, 4, estimate, RNG))
        assert [at for at, _ in selected] == cars_of(selected)


def test_significance_is_the_inverse_of_what_was_received() -> None:
    assert candidate(1, "abcd", True).significance == 0.25
    assert Candidate([measurement(1, b"a")], 2, is_sensed=False).significance == 0.5


def test_measurements_only_sends_measurements_of_cars_at_random() -> None:
    evidence: list[Evidence] = [measurement(1, b"a")]
    evidence += fuse([[measurement(1, b"b"), measurement(1, b"c")]], 1.0)
    candidates = [Candidate(evidence, 2, is_sensed=True), candidate(2, "abcd", False)]

    selections = [result_of(measurements_only(candidates, 2, estimate, RNG)) for _ in range(200)]

    assert all(isinstance(piece, Measurement) for chosen in selections for _, piece in chosen)
    counts = np.bincount([car for chosen in selections for car in cars_of(chosen)])
    assert counts[1] == pytest.approx(200 * 2 / 5, rel=0.3)


def test_random_selection_sends_one_me_of_cars_at_random() -> None:
    candidates = [candidate(car, "ab", is_sensed=car == 0) for car in range(6)]

    selections = [result_of(random_selection(candidates, 2, estimate, RNG)) for _ in range(300)]

    assert all(len(set(cars_of(chosen))) == 2 for chosen in selections)
    counts = np.bincount([car for chosen in selections for car in cars_of(chosen)])
    assert counts.min() > 60


def test_every_selection_of_the_settings_is_there_and_takes_no_candidates() -> None:
    assert set(SELECTIONS) == set(Selection)
    assert all(result_of(select([], 10, estimate, RNG)) == [] for select in SELECTIONS.values())
