"""Footers that have come in: their entries side by side, and why some of them are not used."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from onboard.mvs.belief import doubts
from onboard.mvs.evidence import is_made_by, times_of
from onboard.mvs.kalman import Array
from onboard.mvs.local_frame import LocalFrame
from onboard.mvs.settings import MvsSettings
from onboard.mvs.told import Batch, Told, placed


@dataclass(slots=True, eq=False)
class Heard:
    """A footer not yet taken up."""

    told: Told
    sender_id: bytes
    sender_m: Array
    """Where the sender said it was (2), in the own car's frame."""
    at: float


@dataclass(frozen=True, slots=True)
class OwnMeasurements:
    """What the own car knows of its own measurements."""

    own_ids: frozenset[bytes]
    stamps_ms: frozenset[int]
    """When it made some, UTC."""


def together(heard: Sequence[Heard], frame: LocalFrame, utc_ms: Callable[[float], int]) -> Batch:
    """Put the entries of all footers side by side, placed in `frame`."""
    sources = [each for each in heard for _ in range(len(each.told))]
    return Batch(
        [each.sender_id for each in sources],
        [car for each in heard for car in each.told.cars],
        [provenance for each in heard for provenance in each.told.provenances],
        [utc_ms(each.at) for each in sources],
        placed([each.told for each in heard], frame),
    )


def doubts_of_heard(
    batch: Batch, heard: Sequence[Heard], own: OwnMeasurements, settings: MvsSettings
) -> tuple[dict[int, str], Array]:
    """Hold entries against what is possible (`belief.py`), recent, and known of the own car.

    Returns:
        a reason not to use it for each row of `batch` that has one: those of `belief.doubts`,
        `stale`, `not_my_measurement`; and for each row by what to weight it down.
    """
    belief = settings.belief
    reaches_m = np.full(len(batch), belief.sensing_range_m + belief.radio_range_m)
    oldest_ms = round(settings.memory_s * 1000)
    doubted: dict[int, str] = {}
    tables = [each.told.observers for each in heard for _ in range(len(each.told))]
    has_speed = batch.entries.has_speed.tolist()
    for row, (observers, provenance) in enumerate(zip(tables, batch.provenances, strict=True)):
        if times_of(provenance).first_ms <= batch.received_ms[row] - oldest_ms:
            doubted[row] = "stale"
        elif not own.own_ids.isdisjoint(observers) and not all(
            stamp_ms in own.stamps_ms
            for observer, stamp_ms in provenance
            if observer in own.own_ids
        ):
            doubted[row] = "not_my_measurement"
        if not has_speed[row] and is_made_by(batch.tellers[row], provenance):
            reaches_m[row] = belief.sensing_range_m
    impossible, excess = doubts(
        batch.entries,
        batch.provenances,
        belief,
        reaches_m=reaches_m,
        tellers_m=np.array([each.sender_m for each in heard for _ in range(len(each.told))]).T,
        now_ms=np.array(batch.received_ms, dtype=np.float64),
    )
    return impossible | doubted, excess
