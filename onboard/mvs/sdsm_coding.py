"""Own measurements as the objects of an SDSM, and received SDSMs as measurements of their senders.

An object carries one position with one bound of its error, at 95 % confidence, and no provenance.
So only what the sender measured itself is sent, the newest measurement of each vehicle; a receiver
knows it by sender and time, as it knows an entry of a footer. Speed and heading are for receivers
of other makes: those of a track come from several measurements, and are not read here.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from onboard.errors import DecodeError
from onboard.kinematics.arrays import Array
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages.bsm_core import PositionalAccuracy
from onboard.messages.date_time import DateTime
from onboard.messages.map_data import ReferencePoint
from onboard.messages.sdsm import (
    DetectedObject,
    DetectedObjectData,
    EquipmentType,
    ObjectType,
    PositionConfidenceSet,
    PositionOffset,
    SensorDataSharingMessage,
)
from onboard.mvs.received_footers import MeasuredPlace, SharedEntries, of_measurements
from onboard.tracking.evidence import Measurement

SIGMAS_IN_95_PERCENT = math.sqrt(-2.0 * math.log(0.05))
"""Radius of the circle that holds 95 % of the errors of a position, in sigmas of either axis."""
_TIME_SIGMAS_S = 0.01
"""Error of a measurement's time: of the image's stamp, and of UTC."""
_CONFIDENCE_UNAVAILABLE = 101


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredObject:
    """The newest own measurement of a vehicle, with its velocity by all that is known."""

    number: int
    measurement: Measurement
    velocity_m_s: Array
    """(2) east, north."""
    velocity_sigma_m_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Sender:
    """Who sends an SDSM or CPM, and where it is."""

    source_id: bytes
    anchor: LocalFrame
    sigma_m: float
    """Of its position, on either axis."""
    heading_rad: float | None = None
    """Clockwise from true north."""


def message_of(
    objects: Sequence[MeasuredObject],
    sender: Sender,
    now_ms: int,
    frame: LocalFrame,
    msg_cnt: int,
) -> SensorDataSharingMessage:
    """Return the SDSM that carries `objects`.

    Args:
        objects: at least one, measured at most 1.5 s before `now_ms`, in `frame`.
        sender: the host vehicle.
        now_ms: UTC.
        frame: of `objects`.
        msg_cnt: of the message.
    """
    mapping = sender.anchor.mapping_from(frame)
    return SensorDataSharingMessage(
        msg_cnt=msg_cnt,
        source_id=sender.source_id,
        equipment=EquipmentType.OBU,
        time=DateTime.of_utc(now_ms),
        reference=ReferencePoint(sender.anchor.latitude_deg, sender.anchor.longitude_deg),
        reference_accuracy=PositionalAccuracy(sender.sigma_m, sender.sigma_m, 0.0),
        elevation_confidence_m=None,
        objects=tuple(
            DetectedObjectData(_detected_object(each, now_ms, *mapping)) for each in objects
        ),
    )


def _detected_object(
    each: MeasuredObject, now_ms: int, turn: Array, shift: Array
) -> DetectedObject:
    measurement = each.measurement.mapped(turn, shift)
    east_m, north_m = measurement.position_m.tolist()
    sigma_m = math.sqrt(float(np.linalg.eigvalsh(measurement.covariance)[-1]))
    velocity = turn @ each.velocity_m_s
    return DetectedObject(
        type=ObjectType.VEHICLE,
        type_confidence_percent=_CONFIDENCE_UNAVAILABLE,
        object_id=each.number,
        measurement_time_ms=measurement.stamp_ms - now_ms,
        time_confidence_s=SIGMAS_IN_95_PERCENT * _TIME_SIGMAS_S,
        offset=PositionOffset(east_m, north_m),
        confidence=PositionConfidenceSet(SIGMAS_IN_95_PERCENT * sigma_m),
        speed_m_s=math.hypot(*velocity),
        speed_confidence_m_s=SIGMAS_IN_95_PERCENT * each.velocity_sigma_m_s,
        heading_rad=math.atan2(*velocity) % math.tau,
    )


def entries_in(message: SensorDataSharingMessage, now_ms: int) -> SharedEntries:
    """Return the vehicles in a received SDSM whose position has a confidence, as measurements.

    Args:
        message: the SDSM.
        now_ms: time of receipt, UTC; what the message leaves out of its time is taken from it.

    Raises:
        DecodeError: `no_time`, `no_position`, or `out_of_range` for a time that is none.
    """
    stamp_ms = message.time.utc_ms(now_ms)
    latitude_deg, longitude_deg = message.reference.latitude_deg, message.reference.longitude_deg
    if latitude_deg is None or longitude_deg is None:
        raise DecodeError("no_position", "of the sender")
    places = [
        MeasuredPlace(
            common.object_id,
            stamp_ms + common.measurement_time_ms,
            common.offset.east_m,
            common.offset.north_m,
            common.confidence.position_m / SIGMAS_IN_95_PERCENT,
        )
        for common in (each.common for each in message.objects)
        if common.type is ObjectType.VEHICLE and common.confidence.position_m is not None
    ]
    return of_measurements(message.source_id, LocalFrame(latitude_deg, longitude_deg), places)
