"""What is believed of the evidence in a footer, and how strongly.

A signature says who speaks, not that it is true. Every entry is held against what is physically
possible; what is impossible is dropped under a reason, what is too good to be true is weighted
down to what is possible. What that leaves to a liar is in decision 0074.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from onboard.kinematics.arrays import Array, StateArrays
from onboard.mvs.received_footers import ReceivedFooter
from onboard.mvs.settings import FooterValidationSettings, MvsSettings
from onboard.tracking.evidence import ProvenanceSpans
from onboard.tracking.evidence_store import EvidenceBatch

_NO_SPEED_SIGMA_M_S = 50.0
"""One position says nothing of the speed."""
_FIVE_SIGMA = 5.0
_MOST_EXCESS = 1e5
"""Weighting down by more says nothing of a car, and of a lopsided covariance leaves rounding."""


@dataclass(frozen=True, slots=True)
class OwnMeasurements:
    """What the own car knows of its own measurements."""

    own_ids: frozenset[bytes]
    stamps_ms: frozenset[int]
    """When it made some, UTC."""


def violations_of_received(
    batch: EvidenceBatch,
    heard: Sequence[ReceivedFooter],
    own: OwnMeasurements,
    settings: MvsSettings,
) -> tuple[dict[int, str], Array]:
    """Hold entries against what is possible (`belief.py`), recent, and known of the own car.

    Returns:
        a reason not to use it for each row of `batch` that has one: those of `belief.doubts`,
        `stale`, `not_my_measurement`; and for each row by what to weight it down.
    """
    belief = settings.footer_validation
    received_ms = np.array(batch.received_ms, dtype=np.float64)
    doubted = dict.fromkeys(_with_what_is_not_mine(heard, own), "not_my_measurement")
    stale = batch.spans.oldest_ms <= received_ms - round(settings.memory_s * 1000)
    doubted |= dict.fromkeys(np.flatnonzero(stale).tolist(), "stale")
    reaches_m = np.where(
        batch.firsthand, belief.sensing_range_m, belief.sensing_range_m + belief.radio_range_m
    )
    impossible, excess = violations(
        batch.entries,
        batch.spans,
        belief,
        reaches_m=reaches_m,
        tellers_m=np.array([each.sender_m for each in heard for _ in range(len(each.told))]).T,
        now_ms=received_ms,
    )
    return impossible | dict(sorted(doubted.items())), excess


def violations(
    entries: StateArrays,
    spans: ProvenanceSpans,
    settings: FooterValidationSettings,
    *,
    reaches_m: Array,
    tellers_m: Array,
    now_ms: Array,
) -> tuple[dict[int, str], Array]:
    """Hold evidence against what is possible.

    Args:
        entries: N, in the own car's frame.
        spans: N, of what each was made.
        settings: the bounds.
        reaches_m: (N) how far the car that tells of them can know of each.
        tellers_m: (2, N) where that car is, in the same frame.
        now_ms: (N) when they came, UTC.

    Returns:
        a reason not to use it for each entry that has one, a short stable word: `not_finite`,
        `not_positive`, `future`, `too_many_measurements`, `far`, `too_vague`, `too_fast`,
        `far_too_sure` (what weighting down could not mend); and the N factors of
        `covariance_inflation`, which mean nothing for what is not used.
    """
    whole = entries.has_speed > 0
    finite = np.isfinite(entries.states).all(axis=0)
    finite &= np.isfinite(entries.covariances).all(axis=(0, 1))
    states = np.where(finite, entries.states, 0.0)
    covariances = np.where(finite, entries.covariances, np.eye(4)[:, :, None])
    variances = np.diagonal(covariances).T
    speeds_m_s = np.hypot(*states[2:])
    speed_sigmas_m_s = np.sqrt(np.abs(variances[2] + variances[3]))
    positive = _are_positive(covariances, whole)
    sound = StateArrays(
        entries.stamps_ms,
        states,
        np.where(positive, covariances, np.eye(4)[:, :, None]),
        entries.has_speed,
    )
    excess = covariance_inflation(sound, spans, settings.sharpest_sigma_m)
    vagueness = (variances[0] + variances[1]) / settings.vaguest_sigma_m**2
    wrong = {
        "not_finite": ~finite,
        "not_positive": ~positive,
        "future": entries.stamps_ms > now_ms + settings.clock_tolerance_s * 1000,
        "too_many_measurements": spans.counts > settings.measurements_per_estimate,
        "far": np.hypot(*(states[:2] - tellers_m)) > reaches_m,
        "too_vague": vagueness > 1.0,
        "too_fast": whole & (speeds_m_s > settings.fastest_m_s + _FIVE_SIGMA * speed_sigmas_m_s),
        "far_too_sure": (excess > _MOST_EXCESS) | (excess * vagueness > 1.0),
    }
    reasons: dict[int, str] = {}
    for reason, of_entries in wrong.items():
        for at in np.flatnonzero(of_entries).tolist():
            reasons.setdefault(at, reason)
    return reasons, excess


def covariance_inflation(
    entries: StateArrays, spans: ProvenanceSpans, sharpest_sigma_m: float
) -> Array:
    """By what to multiply each covariance that claims to know more than its provenance allows.

    The best that positions of n moments t_i, each known to sigma, can say of a car that drives
    straight on is sigma^2 / n for its position and sigma^2 / sum (t_i - mean)^2 for its speed.

    Returns:
        N factors, at least 1.
    """
    variance = sharpest_sigma_m**2
    of_speed = variance / np.maximum(spans.spreads_s2, variance / _NO_SPEED_SIGMA_M_S**2)
    factors = variance / spans.counts / _least_eigenvalues(entries.covariances[:2, :2])
    speeds = entries.covariances[2:, 2:] + (1 - entries.has_speed) * np.eye(2)[:, :, None]
    factors_of_speed = entries.has_speed * of_speed / _least_eigenvalues(speeds)
    excess: Array = np.maximum(np.maximum(factors, factors_of_speed), 1.0)
    return excess


def _with_what_is_not_mine(heard: Sequence[ReceivedFooter], own: OwnMeasurements) -> list[int]:
    """The rows that name a measurement of the own car's which it has not made."""
    rows, first = [], 0
    for told in (each.told for each in heard):
        if not own.own_ids.isdisjoint(told.observers):
            not_mine = {
                identity
                for identity in frozenset().union(*told.provenances)
                if identity.observer in own.own_ids and identity.stamp_ms not in own.stamps_ms
            }
            rows += [
                first + at
                for at, provenance in enumerate(told.provenances)
                if not not_mine.isdisjoint(provenance)
            ]
        first += len(told)
    return rows


def _are_positive(covariances: Array, whole: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether each (4, 4) of finite numbers is symmetric and positive; of positions, the (2, 2)."""
    full = np.where(whole, covariances, np.eye(4)[:, :, None])
    full[:2, :2] = covariances[:2, :2]
    largest = np.abs(full).max(axis=(0, 1))
    positive: NDArray[np.bool_] = np.abs(full - full.swapaxes(0, 1)).max(axis=(0, 1)) <= (
        1e-6 * largest
    )
    # By Sylvester: if every pivot is, as the variables are eliminated one after the other.
    while len(full):
        pivot = full[0, 0]
        positive &= pivot > 0.0
        column = full[1:, 0] / np.where(pivot > 0.0, pivot, 1.0)
        full = full[1:, 1:] - column[:, None] * full[0, 1:]
    return positive


def _least_eigenvalues(blocks: Array) -> Array:
    """Of symmetric positive (2, 2, N)."""
    a, b, c = blocks[0, 0], blocks[0, 1], blocks[1, 1]
    # By the determinant: the difference of the usual formula loses all digits near singularity.
    largest = (a + c) / 2 + np.hypot((a - c) / 2, b)
    least: Array = np.maximum((a * c - b * b) / largest, 1e-12)
    return least
