"""Validation and weight of evidence, also of values that no footer can carry."""

import numpy as np
import pytest

from onboard.misbehaviour.evidence_check import covariance_inflation, violations
from onboard.tracking.evidence import (
    Estimate,
    Evidence,
    Measurement,
    ProvenanceSpans,
    as_arrays,
    measurement_id,
)
from onboard.tracking.fusion import fuse
from tests.mvs.attacker import ATTACKER, RECENT, estimate_at


@pytest.mark.parametrize(
    ("state", "covariance", "reason"),
    [
        ([np.nan, 0, 0, 0], np.eye(4), "not_finite"),
        ([0, np.inf, 0, 0], np.eye(4), "not_finite"),
        ([0, 0, 0, 0], np.full((4, 4), np.nan), "not_finite"),
        ([0, 0, 0, 0], np.zeros((4, 4)), "not_positive"),
        ([0, 0, 0, 0], -np.eye(4), "not_positive"),
        ([0, 0, 0, 0], np.diag([1.0, 1.0, 1.0, -1.0]), "not_positive"),
        ([0, 0, 0, 0], np.eye(4) + np.eye(4, k=1), "not_positive"),
        ([3000, 0, 0, 0], np.eye(4), "far"),
        ([0, 0, 200, 0], np.eye(4), "too_fast"),
        ([0, 0, 0, 0], np.diag([0.0, 1.0, 1.0, 1.0]), "not_positive"),
        ([0, 0, 0, 0], np.eye(4) * 1000, "too_vague"),
        ([0, 0, 0, 0], np.eye(4) * 1e-8, "far_too_sure"),
        ([0, 0, 0, 0], np.diag([1.0, 1.0, 1e-4, 1e-4]), "far_too_sure"),
        ([0, 0, 0, 0], np.diag([400.0, 400.0, 1.0, 1.0]), "far_too_sure"),
    ],
)
def test_impossible_estimates_are_named(
    state: list[float], covariance: np.ndarray, reason: str
) -> None:
    piece = Estimate(frozenset({measurement_id(ATTACKER, 5)}), np.array(state, float), covariance)

    moments = frozenset({measurement_id(ATTACKER, 5), measurement_id(ATTACKER, 905)})
    honest = Estimate(moments, np.zeros(4), np.eye(4))

    pieces: list[Evidence] = [honest, piece]

    doubted, _ = violations(
        as_arrays(pieces),
        ProvenanceSpans.of([each.provenance for each in pieces]),
        ranges_m=np.full(2, 1700.0),
        senders_m=np.zeros((2, 2)),
        received_ms=np.full(2, 1000.0),
    )

    assert doubted == {1: reason}


def excess_of_trust_in(*pieces: Evidence) -> np.ndarray:
    spans = ProvenanceSpans.of([piece.provenance for piece in pieces])
    return covariance_inflation(as_arrays(pieces), spans, 0.1)


def test_honest_estimates_are_not_weighted_down() -> None:
    rng = np.random.default_rng(1)
    for n in range(1, 12):
        evidence = [
            Measurement(measurement_id(b"abcd", int(t)), rng.normal(size=2), np.eye(2) * 0.1**2)
            for t in rng.choice(300, n, replace=False)
        ]
        (estimate,) = fuse([evidence], 1.0)
        assert (excess_of_trust_in(estimate, *evidence) == 1.0).all()


def test_weighting_down_keeps_the_shape_of_a_covariance() -> None:
    sure = estimate_at(0, 0, RECENT, sigma_m=0.001)

    (excess,) = excess_of_trust_in(sure)

    assert np.sqrt(sure.covariance[0, 0] * excess) == pytest.approx(0.1 / np.sqrt(3))
