"""What is believed of the evidence in a footer, and how strongly.

A signature says who speaks, not that it is true. Every piece is held against what is physically
possible; what is impossible is dropped under a reason, what is too good to be true is weighted
down to what is possible. What that leaves to a liar is in decision 0074.
"""

import dataclasses
import math

import numpy as np

from onboard.mvs.evidence import Estimate, Evidence, Measurement
from onboard.mvs.kalman import Array
from onboard.mvs.settings import BeliefSettings


class ImplausibleError(Exception):
    """Evidence that is not used; `reason` is a short stable word."""

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(f"{reason}: {detail}")
        self.reason = reason
        self.detail = detail


def check(
    piece: Evidence, reach_m: float, teller_m: Array, now_ms: int, settings: BeliefSettings
) -> None:
    """Hold one piece of evidence against what is possible.

    Args:
        piece: in the own car's frame.
        reach_m: how far the car that tells of it can know of others.
        teller_m: (2) where that car is, in the same frame.
        now_ms: UTC.
        settings: the bounds.

    Raises:
        ImplausibleError: `future`, `too_many_measurements`, `not_finite`, `not_positive`, `far`,
            `too_vague` or `too_fast`.
    """
    ahead_ms = piece.stamp_ms - now_ms
    if ahead_ms > settings.clock_tolerance_s * 1000:
        raise ImplausibleError("future", f"measured {ahead_ms} ms from now")
    if len(piece.provenance) > settings.measurements_per_estimate:
        raise ImplausibleError("too_many_measurements", f"{len(piece.provenance)} in one estimate")
    state = _state(piece)
    if not (np.isfinite(state).all() and np.isfinite(piece.covariance).all()):
        raise ImplausibleError("not_finite", "NaN or infinity")
    _check_positive(piece.covariance)
    away_m = math.dist(state[:2], teller_m)
    if away_m > reach_m:
        raise ImplausibleError("far", f"{away_m:.0f} m from the car that tells of it")
    sigma_m = math.sqrt(np.trace(piece.covariance[:2, :2]))
    if sigma_m > settings.vaguest_sigma_m:
        raise ImplausibleError("too_vague", f"known to {sigma_m:.0f} m only")
    if isinstance(piece, Estimate):
        speed_m_s = math.hypot(*state[2:])
        if speed_m_s > settings.fastest_m_s + 3 * math.sqrt(np.trace(piece.covariance[2:, 2:])):
            raise ImplausibleError("too_fast", f"{speed_m_s:.0f} m/s")


def weighted_down(piece: Evidence, sharpest_sigma_m: float) -> Evidence:
    """Return `piece`, with its covariance enlarged if it claims more than its provenance allows.

    The best that positions of n moments t_i, each known to sigma, can say of a car that drives
    straight on is sigma^2 / n for its position and sigma^2 / sum (t_i - mean)^2 for its speed.
    """
    stamps_s = np.array([stamp_ms for _, stamp_ms in piece.provenance]) / 1000
    variance = sharpest_sigma_m**2
    factor = variance / len(stamps_s) / _least_variance(piece.covariance[:2, :2])
    if isinstance(piece, Estimate):
        spread = float(((stamps_s - stamps_s.mean()) ** 2).sum())
        best = variance / max(spread, variance / _NO_SPEED_SIGMA_M_S**2)
        factor = max(factor, best / _least_variance(piece.covariance[2:, 2:]))
    if factor <= 1.0:
        return piece
    return dataclasses.replace(piece, covariance=piece.covariance * factor)


_NO_SPEED_SIGMA_M_S = 50.0
"""One position says nothing of the speed."""


def _state(piece: Evidence) -> Array:
    return piece.position_m if isinstance(piece, Measurement) else piece.state


def _check_positive(covariance: Array) -> None:
    if np.abs(covariance - covariance.T).max() > 1e-6 * np.abs(covariance).max():
        raise ImplausibleError("not_positive", "the covariance is not symmetric")
    try:
        np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        raise ImplausibleError("not_positive", "a variance is zero or negative") from None


def _least_variance(block: Array) -> float:
    """The smaller eigenvalue of a symmetric (2, 2)."""
    a, b, c = float(block[0, 0]), float(block[0, 1]), float(block[1, 1])
    half = (a + c) / 2
    least = half - math.sqrt((a - c) ** 2 / 4 + b * b)
    # Near-singular blocks lose the difference to rounding; the determinant keeps it.
    return max(least, (a * c - b * b) / (2 * half), 1e-12)
