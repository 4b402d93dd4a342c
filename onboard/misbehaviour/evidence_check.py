"""Evidence of others against what is physically possible, whoever sent it.

A signature proves the sender, not the content. An impossible entry is dropped with a reason, one
that claims more certainty than its provenance allows gets a larger covariance. The remaining gaps
are in docs/design/mvs.md.
"""

import numpy as np
from numpy.typing import NDArray

from onboard.kinematics.arrays import Array, StateArrays
from onboard.tracking.evidence import ProvenanceSpans

CLOCK_TOLERANCE_S = 0.1
"""Time by which a sender's clock may be ahead of the host's."""
RADIO_RANGE_M = 1500.0
"""No sender is received from farther away: beyond the range of DSRC in the open."""
SENSING_RANGE_M = 200.0
"""No camera or radar measures vehicles farther away."""
MAX_SPEED_M_S = 90.0
"""No vehicle on a road is faster."""
MIN_SIGMA_M = 0.1
"""No single measurement is better; estimates are limited by what this allows them."""
MAX_SIGMA_M = 30.0
"""A position that is worse has no use."""
MAX_MEASUREMENTS_PER_ESTIMATE = 64
"""Measurements in one estimate; bounds computing time."""

_UNKNOWN_SPEED_SIGMA_M_S = 50.0
"""Speed of a vehicle of which one position is known."""
_FIVE_SIGMA = 5.0
_MAX_INFLATION = 1e5
"""Above this factor nothing is left of an entry but the rounding of its covariance."""


def violations(
    entries: StateArrays,
    spans: ProvenanceSpans,
    *,
    ranges_m: Array,
    senders_m: Array,
    received_ms: Array,
    max_measurements: int = MAX_MEASUREMENTS_PER_ESTIMATE,
) -> tuple[dict[int, str], Array]:
    """Check N entries against what is physically possible.

    Args:
        entries: N, in the host vehicle's frame.
        spans: N, of their provenances.
        ranges_m: (N) distance from its sender at which each may be.
        senders_m: (2, N) positions of the senders, in the same frame.
        received_ms: (N) times of receipt, UTC.
        max_measurements: in one estimate.

    Returns:
        a reason not to use it for each entry that has one, a short stable word: `not_finite`,
        `not_positive`, `future`, `too_many_measurements`, `far`, `too_vague`, `too_fast`,
        `far_too_sure` (inflation would not leave a usable entry); and the N factors of
        `covariance_inflation`, without meaning for entries that are not used.
    """
    is_estimate = entries.has_speed > 0
    finite = np.isfinite(entries.states).all(axis=0)
    finite &= np.isfinite(entries.covariances).all(axis=(0, 1))
    states = np.where(finite, entries.states, 0.0)
    covariances = np.where(finite, entries.covariances, np.eye(4)[:, :, None])
    variances = np.diagonal(covariances).T
    speeds_m_s = np.hypot(*states[2:])
    speed_sigmas_m_s = np.sqrt(np.abs(variances[2] + variances[3]))
    positive = _are_positive(covariances, is_estimate)
    sound = StateArrays(
        entries.stamps_ms,
        states,
        np.where(positive, covariances, np.eye(4)[:, :, None]),
        entries.has_speed,
    )
    inflation = covariance_inflation(sound, spans, MIN_SIGMA_M)
    vagueness = (variances[0] + variances[1]) / MAX_SIGMA_M**2
    max_speeds_m_s = MAX_SPEED_M_S + _FIVE_SIGMA * speed_sigmas_m_s
    failed = {
        "not_finite": ~finite,
        "not_positive": ~positive,
        "future": entries.stamps_ms > received_ms + CLOCK_TOLERANCE_S * 1000,
        "too_many_measurements": spans.counts > max_measurements,
        "far": np.hypot(*(states[:2] - senders_m)) > ranges_m,
        "too_vague": vagueness > 1.0,
        "too_fast": is_estimate & (speeds_m_s > max_speeds_m_s),
        "far_too_sure": (inflation > _MAX_INFLATION) | (inflation * vagueness > 1.0),
    }
    reasons: dict[int, str] = {}
    for reason, of_entries in failed.items():
        for at in np.flatnonzero(of_entries).tolist():
            reasons.setdefault(at, reason)
    return reasons, inflation


def covariance_inflation(entries: StateArrays, spans: ProvenanceSpans, min_sigma_m: float) -> Array:
    """Return factors for covariances that claim more certainty than their provenances allow.

    Positions at n times t_i, each with the same sigma, give the position of a vehicle at constant
    velocity with a variance of sigma^2 / n at best, its speed with sigma^2 / sum (t_i - mean)^2.

    Args:
        entries: N.
        spans: N, of their provenances.
        min_sigma_m: sigma of the best possible measurement.

    Returns:
        N factors, at least 1.
    """
    variance = min_sigma_m**2
    of_speed = variance / np.maximum(spans.spreads_s2, variance / _UNKNOWN_SPEED_SIGMA_M_S**2)
    factors = variance / spans.counts / _least_eigenvalues(entries.covariances[:2, :2])
    speeds = entries.covariances[2:, 2:] + (1 - entries.has_speed) * np.eye(2)[:, :, None]
    factors_of_speed = entries.has_speed * of_speed / _least_eigenvalues(speeds)
    inflation: Array = np.maximum(np.maximum(factors, factors_of_speed), 1.0)
    return inflation


def _are_positive(covariances: Array, is_estimate: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether each finite (4, 4) is symmetric and positive; of positions, the (2, 2) block."""
    full = np.where(is_estimate, covariances, np.eye(4)[:, :, None])
    full[:2, :2] = covariances[:2, :2]
    largest = np.abs(full).max(axis=(0, 1))
    positive: NDArray[np.bool_] = np.abs(full - full.swapaxes(0, 1)).max(axis=(0, 1)) <= (
        1e-6 * largest
    )
    # Sylvester's criterion: every pivot of the elimination is positive.
    while len(full):
        pivot = full[0, 0]
        positive &= pivot > 0.0
        column = full[1:, 0] / np.where(pivot > 0.0, pivot, 1.0)
        full = full[1:, 1:] - column[:, None] * full[0, 1:]
    return positive


def _least_eigenvalues(blocks: Array) -> Array:
    """Least eigenvalues (N) of symmetric positive (2, 2, N)."""
    a, b, c = blocks[0, 0], blocks[0, 1], blocks[1, 1]
    # By the determinant: the difference of the usual formula loses all digits near singularity.
    largest = (a + c) / 2 + np.hypot((a - c) / 2, b)
    least: Array = np.maximum((a * c - b * b) / largest, 1e-12)
    return least
