"""Tracks of vehicles without a radio as perceived objects."""

from collections.abc import Iterable, Sequence

from onboard.tracking.evidence import Estimate
from onboard.tracking.fusion import propagate
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from onboard.tracking.track import Track


def without_radio(tracks: Iterable[Track]) -> list[Track]:
    """Return the tracks that are reported, and are no vehicle that sends BSMs."""
    return [track for track in tracks if track.is_reported and track.remote_vehicle_id is None]


def as_tracked_objects(
    now: float, now_ms: int, tracks: Sequence[Track], estimates: Sequence[Estimate], q: float
) -> list[PerceivedObject]:
    """Return tracks as objects, each fused with its duplicates, and predicted to `now`.

    Args:
        now: the time.
        now_ms: the same, UTC.
        tracks: of vehicles.
        estimates: where each is placed.
        q: spectral density of the acceleration noise, m^2/s^3.
    """
    states, covariances = propagate(estimates, now_ms, q)
    return [
        PerceivedObject(
            stamp_s=now,
            name=str(track.number),
            source=ObjectSource.SENSOR if track.is_sensed else ObjectSource.SHARED,
            state=tuple(state),
            covariance=tuple(map(tuple, covariance)),
            age_s=(now_ms - estimate.stamp_ms) / 1000,
            provenance=estimate.provenance,
            tracked_for_s=(now_ms - track.first_ms) / 1000,
            is_sensed=track.is_sensed,
            reporters=track.reporters.union(*[each.reporters for each in track.duplicates]),
        )
        for track, estimate, state, covariance in zip(
            tracks,
            estimates,
            states.T.tolist(),
            covariances.transpose(2, 0, 1).tolist(),
            strict=True,
        )
    ]
