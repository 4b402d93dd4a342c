"""What is believed of the evidence in a footer, and how strongly.

A signature says who speaks, not that it is true. Every piece is held against what is physically
possible; what is impossible is dropped under a reason, what is too good to be true is weighted
down to what is possible. What that leaves to a liar is in decision 0074.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from onboard.mvs.association import Kinematics
from onboard.mvs.evidence import Evidence
from onboard.mvs.kalman import Array
from onboard.mvs.settings import BeliefSettings

_NO_SPEED_SIGMA_M_S = 50.0
"""One position says nothing of the speed."""
_FIVE_SIGMA = 5.0


def doubts(
    pieces: Sequence[Evidence],
    reaches_m: Array,
    teller_m: Array,
    now_ms: int,
    settings: BeliefSettings,
) -> dict[int, str]:
    """Hold evidence against what is possible.

    Args:
        pieces: N, in the own car's frame.
        reaches_m: (N) how far the car that tells of them can know of each.
        teller_m: (2) where that car is, in the same frame.
        now_ms: UTC.
        settings: the bounds.

    Returns:
        a reason not to use it for each piece that has one, a short stable word: `not_finite`,
        `not_positive`, `future`, `too_many_measurements`, `far`, `too_vague`, `too_fast`.
    """
    told = Kinematics.of(pieces)
    whole = told.has_speed > 0
    finite = np.isfinite(told.states).all(axis=0) & np.isfinite(told.covariances).all(axis=(0, 1))
    states = np.where(finite, told.states, 0.0)
    covariances = np.where(finite, told.covariances, np.eye(4)[:, :, None])
    variances = np.diagonal(covariances).T
    speeds_m_s = np.hypot(*states[2:])
    speed_sigmas_m_s = np.sqrt(np.abs(variances[2] + variances[3]))
    counts = np.array([len(piece.provenance) for piece in pieces])
    wrong = {
        "not_finite": ~finite,
        "not_positive": ~_are_positive(covariances, whole),
        "future": told.stamps_ms > now_ms + settings.clock_tolerance_s * 1000,
        "too_many_measurements": counts > settings.measurements_per_estimate,
        "far": np.hypot(*(states[:2] - teller_m[:, None])) > reaches_m,
        "too_vague": variances[0] + variances[1] > settings.vaguest_sigma_m**2,
        "too_fast": whole & (speeds_m_s > settings.fastest_m_s + _FIVE_SIGMA * speed_sigmas_m_s),
    }
    reasons: dict[int, str] = {}
    for reason, of_pieces in wrong.items():
        for at in np.flatnonzero(of_pieces).tolist():
            reasons.setdefault(at, reason)
    return reasons


def weighted_down(pieces: Sequence[Evidence], sharpest_sigma_m: float) -> dict[int, Evidence]:
    """Enlarge the covariance of what claims to know more than its provenance allows.

    The best that positions of n moments t_i, each known to sigma, can say of a car that drives
    straight on is sigma^2 / n for its position and sigma^2 / sum (t_i - mean)^2 for its speed.

    Returns:
        the pieces that claimed too much, as they may be used.
    """
    if not pieces:
        return {}
    told = Kinematics.of(pieces)
    counts, spreads = np.array([_count_and_spread(piece) for piece in pieces]).T
    variance = sharpest_sigma_m**2
    of_speed = variance / np.maximum(spreads, variance / _NO_SPEED_SIGMA_M_S**2)
    factors = variance / counts / _least_eigenvalues(told.covariances[:2, :2])
    speeds = told.covariances[2:, 2:] + (1 - told.has_speed) * np.eye(2)[:, :, None]
    factors_of_speed = told.has_speed * of_speed / _least_eigenvalues(speeds)
    factors = np.maximum(factors, factors_of_speed)
    return {
        at: dataclasses.replace(pieces[at], covariance=pieces[at].covariance * factors[at])
        for at in np.flatnonzero(factors > 1.0).tolist()
    }


def _count_and_spread(piece: Evidence) -> tuple[int, float]:
    """How many measurements, and the sum of squares of their times about the mean, s^2."""
    ages_ms = [piece.stamp_ms - stamp_ms for _, stamp_ms in piece.provenance]
    squares = sum([age_ms * age_ms for age_ms in ages_ms])
    return len(ages_ms), (squares - sum(ages_ms) ** 2 / len(ages_ms)) / 1e6


def _are_positive(covariances: Array, whole: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether each (4, 4) of finite numbers is symmetric and positive; of positions, the (2, 2)."""
    full = np.where(whole, covariances, np.eye(4)[:, :, None])
    full[:2, :2] = covariances[:2, :2]
    full = full.transpose(2, 0, 1)
    largest = np.abs(full).max(axis=(1, 2))
    symmetric = np.abs(full - full.transpose(0, 2, 1)).max(axis=(1, 2)) <= 1e-6 * largest
    positive: NDArray[np.bool_] = symmetric & (np.linalg.eigvalsh(full)[:, 0] > 0.0)
    return positive


def _least_eigenvalues(blocks: Array) -> Array:
    """Of symmetric positive (2, 2, N)."""
    a, b, c = blocks[0, 0], blocks[0, 1], blocks[1, 1]
    # By the determinant: the difference of the usual formula loses all digits near singularity.
    largest = (a + c) / 2 + np.hypot((a - c) / 2, b)
    least: Array = np.maximum((a * c - b * b) / largest, 1e-12)
    return least
