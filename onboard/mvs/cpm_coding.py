"""Evidence as the objects of a CPM, and received CPMs as evidence.

Position, velocity and time of an object are for every receiver. What MVS needs besides, covariances
and provenance, is in the addition to the object container. A CPM without it is of another make: its
objects are measurements of its sender, each known by sender and time, as those of an SDSM.
"""

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from onboard.errors import DecodeError
from onboard.its_g5.its_timestamp import timestamp_ms, utc_of
from onboard.kinematics.arrays import Array
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import cpm
from onboard.messages.cpm import (
    CollectivePerceptionMessage,
    ManagementContainer,
    Orientation,
    PerceivedObjectContainer,
)
from onboard.messages.cpm_evidence import (
    ESTIMATE,
    MEASUREMENT,
    VERSION,
    CpmEvidence,
    EstimateEvidence,
    MeasurementEvidence,
)
from onboard.messages.cpm_object import (
    CARTESIAN,
    MAX_OBJECTS,
    VEHICLE,
    CartesianVelocity,
    Coordinate,
    CpmObject,
    ObjectClass,
    ObjectPosition,
    VelocityComponent,
)
from onboard.messages.fields import Chosen
from onboard.messages.its_common import ConfidenceEllipse, ReferencePosition
from onboard.messages.mvs_footer import MAX_OBSERVERS
from onboard.mvs.footer_coding import from_correlations, runs_of, to_correlations
from onboard.mvs.received_footers import MeasuredPlace, SharedEntries, of_measurements
from onboard.mvs.sdsm_coding import SIGMAS_IN_95_PERCENT, Sender
from onboard.tracking.evidence import (
    Evidence,
    Measurement,
    Provenance,
    ProvenanceSpans,
    measured_ms,
    measurement_id,
    observer_of,
)

BOUND_SIGMAS = 1.96
"""Bound of 95 % of a normally distributed error along one axis, in sigmas."""
MAX_AGE_MS = 2048
"""Before the reference time, of what a CPM can carry."""
NO_CONFIDENCE = 0
"""Quality of an object that its sender knows from others: not to be taken for its measurement."""
_OUT_OF_RANGE_M = 40.95
"""Code of a bound that is larger than those of the range."""
_UNKNOWN_VEHICLE = 0
"""Station type."""


@dataclass(frozen=True, slots=True, eq=False)
class SharedObject:
    """A piece of evidence of a vehicle, with its velocity by all that is known."""

    number: int
    piece: Evidence
    velocity_m_s: Array
    """(2) east, north; of an estimate its own is sent."""
    velocity_sigma_m_s: float
    is_sensed: bool
    """Whether own sensors have measured it, and not only others."""


def encode_within(
    objects: Sequence[SharedObject],
    sender: Sender,
    reference_ms: int,
    frame: LocalFrame,
    max_bytes: int,
    *,
    perceived: int,
) -> tuple[CollectivePerceptionMessage, list[SharedObject]]:
    """Return the CPM with the first of `objects`, as many as fit, and these.

    No CPM is sent in segments: what does not fit is due for the next one.

    Args:
        objects: of evidence in `frame`, the most important first.
        sender: the host vehicle.
        reference_ms: UTC, not before the last measurement.
        frame: of `objects`.
        max_bytes: size of the CPM.
        perceived: how many objects the sender perceives in all.
    """
    fitting = [
        each
        for each in objects
        if all(0 <= reference_ms - measured_ms(one) <= MAX_AGE_MS for one in each.piece.provenance)
    ][:MAX_OBJECTS]

    def message_of(count: int) -> CollectivePerceptionMessage:
        return _message_of(fitting[:count], sender, reference_ms, frame, perceived)

    def is_too_long(message: CollectivePerceptionMessage) -> bool:
        evidence = message.perceived.evidence
        has_names = evidence is None or len(evidence.observers) <= MAX_OBSERVERS
        return not has_names or len(cpm.encode(message)) > max_bytes

    message = message_of(len(fitting))
    if is_too_long(message):
        counts = range(1, len(fitting))
        fitting = fitting[: bisect_left(counts, x=True, key=lambda n: is_too_long(message_of(n)))]
        message = message_of(len(fitting))
    return message, fitting


def _message_of(
    objects: Sequence[SharedObject],
    sender: Sender,
    reference_ms: int,
    frame: LocalFrame,
    perceived_in_all: int,
) -> CollectivePerceptionMessage:
    turn, shift = sender.anchor.mapping_from(frame)
    observers: dict[bytes, int] = {}
    perceived, pieces = [], []
    for each in objects:
        mapped = each.piece.mapped(turn, shift)
        velocity = turn @ each.velocity_m_s
        sigmas, correlations = to_correlations(mapped.covariance)
        velocity_sigmas = [each.velocity_sigma_m_s] * 2
        if isinstance(mapped, Measurement):
            place_m = mapped.position_m
            observer = observers.setdefault(observer_of(mapped.id), len(observers))
            evidence = MeasurementEvidence(observer, *sigmas, *correlations)
            pieces.append(Chosen(MEASUREMENT, evidence))
        else:
            place_m, velocity, velocity_sigmas = mapped.state[:2], mapped.state[2:], sigmas[2:]
            runs = runs_of(mapped.provenance, reference_ms, observers)
            numbers: list[Any] = [*sigmas, *correlations, runs]
            pieces.append(Chosen(ESTIMATE, EstimateEvidence(*numbers)))
        perceived.append(
            CpmObject(
                each.number,
                mapped.stamp_ms - reference_ms,
                ObjectPosition(*map(_coordinate, place_m.tolist(), sigmas[:2])),
                Chosen(
                    CARTESIAN,
                    CartesianVelocity(*map(_component, velocity.tolist(), velocity_sigmas)),
                ),
                quality=None if each.is_sensed else NO_CONFIDENCE,
                classes=(ObjectClass(Chosen(VEHICLE, _UNKNOWN_VEHICLE)),),
            )
        )
    bound_m = SIGMAS_IN_95_PERCENT * sender.sigma_m
    here = ReferencePosition(
        sender.anchor.latitude_deg,
        sender.anchor.longitude_deg,
        ConfidenceEllipse(bound_m, bound_m, 0.0),
    )
    return CollectivePerceptionMessage(
        sender.source_id,
        ManagementContainer(timestamp_ms(reference_ms / 1000), here),
        Orientation(sender.heading_rad),
        is_road_side_unit=False,
        perceived=PerceivedObjectContainer(
            min(max(len(perceived), perceived_in_all), MAX_OBJECTS),
            tuple(perceived),
            CpmEvidence(VERSION, tuple(observers), tuple(pieces)),
        ),
    )


def _coordinate(value_m: float, sigma_m: float) -> Coordinate:
    return Coordinate(value_m, _bound(sigma_m))


def _component(value_m_s: float, sigma_m_s: float) -> VelocityComponent:
    return VelocityComponent(value_m_s, _bound(sigma_m_s))


def _bound(sigma: float) -> float:
    """Return the bound of 95 % in whole steps of 0.01, which are the wire's, rounded up."""
    return math.ceil(BOUND_SIGMAS * sigma * 100.0) / 100.0


def entries_in(message: CollectivePerceptionMessage) -> SharedEntries:
    """Return the vehicles in a received CPM as evidence.

    Raises:
        DecodeError: `no_position`; `unknown_observer`, `repeated_measurement` or
            `contradictory_containers` for evidence that is not of its object.
    """
    place = message.management.position
    if place.latitude_deg is None or place.longitude_deg is None:
        raise DecodeError("no_position", "of the sender")
    anchor = LocalFrame(place.latitude_deg, place.longitude_deg)
    reference_ms = round(utc_of(message.management.reference_time_ms / 1e3) * 1e3)
    if message.perceived.evidence is None:
        return _measured(message, anchor, reference_ms)
    return _evident(message.perceived.objects, message.perceived.evidence, anchor, reference_ms)


def _measured(
    message: CollectivePerceptionMessage, anchor: LocalFrame, reference_ms: int
) -> SharedEntries:
    """Return the objects of another make. What correlates the two axes is not known.

    So the variance on either axis is the sum of both: none in any direction is larger.
    """
    places = [
        MeasuredPlace(
            _number_of(each, at),
            reference_ms + each.measurement_delta_time_ms,
            each.position.east.value_m,
            each.position.north.value_m,
            bound_m / BOUND_SIGMAS,
        )
        for at, each in enumerate(message.perceived.objects)
        if each.is_vehicle
        and each.quality != NO_CONFIDENCE
        and (bound_m := _bound_of(each.position)) is not None
    ]
    return of_measurements(message.station_id, anchor, places)


def _number_of(each: CpmObject, at: int) -> int:
    """Return the number of an object; without one, its place in the message."""
    return at if each.object_id is None else each.object_id


def _bound_of(position: ObjectPosition) -> float | None:
    """Return the root of the sum of both squared bounds; `None` if one is not known."""
    bounds_m = position.east.confidence_m, position.north.confidence_m
    if any(each is None or each >= _OUT_OF_RANGE_M for each in bounds_m):
        return None
    return math.hypot(*(each or 0.0 for each in bounds_m))


def _evident(
    objects: Sequence[CpmObject],
    evidence: CpmEvidence,
    anchor: LocalFrame,
    reference_ms: int,
) -> SharedEntries:
    n = len(objects)
    states, covariances, has_speed = np.zeros((n, 4)), np.zeros((n, 4, 4)), np.zeros(n)
    provenances: list[Provenance] = []
    for row, (each, piece) in enumerate(zip(objects, evidence.pieces, strict=True)):
        stamp_ms = reference_ms + each.measurement_delta_time_ms
        states[row, :2] = each.position.east.value_m, each.position.north.value_m
        content = piece.value
        if piece.name == ESTIMATE:
            has_speed[row] = 1.0
            states[row, 2:] = _velocity_m_s(each)
            provenances.append(_provenance(content, evidence.observers, reference_ms, stamp_ms))
        else:
            observer = _observer(evidence.observers, content.observer)
            provenances.append(frozenset((measurement_id(observer, stamp_ms),)))
        size = 4 if piece.name == ESTIMATE else 2
        covariances[row, :size, :size] = _covariance(content)
    return SharedEntries(
        anchor,
        [_number_of(each, at) for at, each in enumerate(objects)],
        provenances,
        frozenset(evidence.observers),
        ProvenanceSpans.of(provenances),
        states=states,
        covariances=covariances,
        has_speed=has_speed,
    )


def _covariance(content: MeasurementEvidence | EstimateEvidence) -> Array:
    if isinstance(content, MeasurementEvidence):
        sigmas = [content.sigma_east_m, content.sigma_north_m]
        correlations = [content.correlation]
    else:
        sigmas = [
            content.sigma_east_m,
            content.sigma_north_m,
            content.sigma_speed_east_m_s,
            content.sigma_speed_north_m_s,
        ]
        correlations = [
            content.correlation_10,
            content.correlation_20,
            content.correlation_21,
            content.correlation_30,
            content.correlation_31,
            content.correlation_32,
        ]
    covariance: Array = from_correlations(np.array([sigmas]), np.array([correlations]))[0]
    return covariance


def _velocity_m_s(each: CpmObject) -> tuple[float, float]:
    velocity = None if each.velocity is None else each.velocity.value
    if isinstance(velocity, CartesianVelocity):
        east_m_s, north_m_s = velocity.east.value_m_s, velocity.north.value_m_s
        if east_m_s is not None and north_m_s is not None:
            return east_m_s, north_m_s
    raise DecodeError("contradictory_containers", "an estimate without a velocity")


def _provenance(
    content: EstimateEvidence, observers: Sequence[bytes], reference_ms: int, stamp_ms: int
) -> Provenance:
    named = [
        measurement_id(_observer(observers, run.observer), reference_ms - age_ms)
        for run in content.runs
        for age_ms in run.ages_ms
    ]
    provenance = frozenset(named)
    if len(provenance) < len(named):
        raise DecodeError("repeated_measurement", "in the provenance of an estimate")
    if max(map(measured_ms, provenance)) != stamp_ms:
        raise DecodeError("contradictory_containers", "an object is not as old as its evidence")
    return provenance


def _observer(observers: Sequence[bytes], number: int) -> bytes:
    if number >= len(observers):
        raise DecodeError("unknown_observer", f"number {number} of {len(observers)}")
    return observers[number]
