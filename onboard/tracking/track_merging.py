"""Which tracks are merged, and which of two possible duplicates is reported."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from onboard.kinematics.arrays import Array, StateArrays
from onboard.tracking.association import CERTAIN_M, OVERLAP_M
from onboard.tracking.gates import GATE_PROBABILITY, distances, gates
from onboard.tracking.track import Track

MAX_REPORTED_SIGMA_M = 4.0
"""A track whose position is less certain than this (root of the summed variances) is not reported:
it would be taken for a vehicle in any of three lanes."""

_NEAR_M = 8.0
"""Tracks farther apart than this count as two vehicles, however uncertain they are. Errors of two
observers that persist from image to image can place one vehicle this far apart."""


def merge_tracks(
    tracks: Sequence[Track], states: StateArrays, now_ms: int, q: float
) -> tuple[dict[int, int], list[set[int]]]:
    """Merge tracks of one vehicle.

    Two tracks that overlap are merged, if they share a measurement or are certain enough, unless
    one observer measured both at one time. The bound on their certainty is `CERTAIN_M` for a new
    track and grows with the age of the younger, to twice this after 0.25 s and five times after
    1 s: otherwise a vehicle that is only ever measured uncertainly would stay two tracks.

    Args:
        tracks: N of them.
        states: their states with a speed prior.
        now_ms: UTC.
        q: spectral density of the acceleration noise, m^2/s^3.

    Returns:
        by index of each track that was merged into another that one's index; for each track the
        indices of those that may be duplicates of it, but are not certain enough to be merged.
    """
    near, apart_m = _near(states.positions_m(now_ms))
    merged: dict[int, int] = {}
    duplicates: list[set[int]] = [set() for _ in tracks]
    if not len(near):
        return merged, duplicates
    one, other = states[near[:, 0]], states[near[:, 1]]
    squared, _, variance = distances(one, other, q)
    compatible = squared <= gates(one, GATE_PROBABILITY)
    close = apart_m <= OVERLAP_M
    candidates = compatible | close
    for (i, j), fits, overlaps, spread in zip(
        near[candidates].tolist(),
        compatible[candidates].tolist(),
        close[candidates].tolist(),
        variance[candidates].tolist(),
        strict=True,
    ):
        if i in merged or j in merged:
            continue
        first, second = tracks[i], tracks[j]
        if first.was_measured_beside(second):
            continue
        age_s = (now_ms - max(first.first_ms, second.first_ms)) / 1000
        certain = spread <= (CERTAIN_M * (1.0 + 4.0 * age_s)) ** 2
        if overlaps and (certain or first.shares_measurement_with(second)):
            first.merge(second)
            merged[j] = i
        elif fits and first.is_confirmed and second.is_confirmed:
            duplicates[i].add(j)
            duplicates[j].add(i)
    return merged, duplicates


def _near(positions: Array) -> tuple[NDArray[np.intp], Array]:
    """Pairs (K, 2) among positions (2, N) that are closer than `_NEAR_M`; their distances (K)."""
    east = positions[0]
    pairs = np.argwhere(np.abs(east[:, None] - east) < _NEAR_M)
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    apart_m: Array = np.hypot(*(positions[:, pairs[:, 0]] - positions[:, pairs[:, 1]]))
    near = apart_m < _NEAR_M
    return pairs[near], apart_m[near]


def choose_reported(
    tracks: Sequence[Track],
    kept: Sequence[int],
    duplicates: Sequence[set[int]],
    variances: Array,
) -> None:
    """Report each vehicle once: of possible duplicates the sensed track, else the more certain.

    So an attacker cannot hide a vehicle that the own sensors measure. A track that is not reported
    does not suppress its own duplicates. Where all possible duplicates of a track are so of each
    other, and of no further track, they are taken for one vehicle that several observers place
    differently, unless own sensors measure it: they know best where it is from here. Tracks too
    uncertain to be reported do not count as duplicates in this: one may be any of its neighbours.

    Args:
        tracks: N of them; `is_reported` and `duplicates` of each are set.
        kept: indices of those that were not merged into another.
        duplicates: of each track, as `merge_tracks` returns them.
        variances: (N) of position, summed over both axes, m^2.
    """
    reported: set[int] = set()
    certain = {at for at in kept if variances[at] <= MAX_REPORTED_SIGMA_M**2}
    for at in sorted(kept, key=lambda at: (not tracks[at].is_sensed, variances[at])):
        track = tracks[at]
        track.is_reported = (
            track.is_confirmed and at in certain and reported.isdisjoint(duplicates[at])
        )
        track.duplicates = []
        if track.is_reported:
            reported.add(at)
            alike = {at} | (duplicates[at] & certain)
            others = [tracks[one] for one in sorted(alike - {at})]
            are_one = all({one} | (duplicates[one] & certain) == alike for one in alike)
            if are_one and _may_be_fused([track, *others]):
                track.duplicates = others


def _may_be_fused(tracks: Sequence[Track]) -> bool:
    """Whether no measurement is in two, none has a radio, and own sensors measure none."""
    if any(track.is_sensed or track.remote_vehicle_id is not None for track in tracks):
        return False
    provenances = [track.estimate.provenance for track in tracks]
    return len(frozenset().union(*provenances)) == sum(map(len, provenances))


def position_variances(states: StateArrays, now_ms: int, q: float) -> Array:
    """Return the variances (N) of predicted positions, summed over both axes, m^2.

    Args:
        states: N of them.
        now_ms: time of the prediction, UTC.
        q: density of the process noise, m^2/s^3.
    """
    dt, p = (now_ms - states.stamps_ms) / 1000, states.covariances
    grown: Array = (
        p[0, 0]
        + p[1, 1]
        + dt * (2 * (p[0, 2] + p[1, 3]) + dt * (p[2, 2] + p[3, 3]))
        + 2 * q * np.abs(dt) ** 3 / 3
    )
    return grown
