"""What the certificate of a sender permits it to say in CAMs and DENMs: their SSPs.

An SSP is an octet with the version and a bitmap, most significant bit first (EN 302 637-2 V1.4.1,
6.2.2.1; EN 302 637-3 V1.3.1, 6.2.2.1, of which TS 103 831 has a second version with an octet more).
The bits were compared with those of another implementation. A certificate without an SSP, or with
one of another version, permits an ordinary CAM and no DENM; that is ours.
"""

from collections.abc import Iterator
from enum import IntFlag

from onboard.errors import DecodeError
from onboard.messages.cam import Cam, HighFrequency
from onboard.messages.cam_special import (
    Emergency,
    EmergencyPriority,
    RoadSideContainer,
    RoadWorks,
    SafetyCar,
    TrafficRule,
)
from onboard.messages.denm import DANGEROUS_SITUATION, STATIONARY_VEHICLE, Denm

_VERSIONS = 1, 2


class CamPermission(IntFlag):
    """The bits after the version of a CAM's SSP."""

    TOLLING_ZONE = 0x8000
    PUBLIC_TRANSPORT = 0x4000
    SPECIAL_TRANSPORT = 0x2000
    DANGEROUS_GOODS = 0x1000
    ROAD_WORKS = 0x0800
    RESCUE = 0x0400
    EMERGENCY = 0x0200
    SAFETY_CAR = 0x0100
    CLOSED_LANES = 0x0080
    RIGHT_OF_WAY = 0x0040
    FREE_CROSSING_AT_SIGNAL = 0x0020
    NO_PASSING = 0x0010
    NO_PASSING_FOR_TRUCKS = 0x0008
    SPEED_LIMIT = 0x0004


DENM_CAUSES = (
    1, 2, 3, 6, 9, 10, 11, 12, 14, 15, 17, 18, 19, 26, 27, 91, 92, 93, 94, 95, 96, 97, 98, 99,
    5, 7, 28, 100,
)  # fmt: skip
"""Causes by the bits after the version of a DENM's SSP; those from 5 on in version 2 only."""

_RULES = {
    TrafficRule.NO_PASSING: CamPermission.NO_PASSING,
    TrafficRule.NO_PASSING_FOR_TRUCKS: CamPermission.NO_PASSING_FOR_TRUCKS,
}
_PRIORITIES = {
    EmergencyPriority.RIGHT_OF_WAY: CamPermission.RIGHT_OF_WAY,
    EmergencyPriority.FREE_CROSSING_AT_SIGNAL: CamPermission.FREE_CROSSING_AT_SIGNAL,
}


def cam_ssp(permissions: int = 0) -> bytes:
    """Return the SSP with these `CamPermission`s; by default that of an ordinary car."""
    return bytes((1,)) + permissions.to_bytes(2)


def denm_ssp(causes: tuple[int, ...] = (STATIONARY_VEHICLE, DANGEROUS_SITUATION)) -> bytes:
    """Return the SSP, version 1, that permits events of these causes; by default our own.

    Raises:
        ValueError: a cause has no bit.
    """
    places = [DENM_CAUSES[:24].index(cause) for cause in causes]
    return bytes((1,)) + sum(1 << 23 - place for place in places).to_bytes(3)


def check_cam(message: Cam, ssp: bytes | None) -> None:
    """Check that the certificate with this SSP permits a CAM.

    Raises:
        DecodeError: `not_permitted`.
    """
    granted = int.from_bytes(_bits(ssp)[:2].ljust(2, b"\0"))
    missing = [each for each in _needed(message) if not each & granted]
    if missing:
        raise DecodeError("not_permitted", ", ".join(str(each.name).lower() for each in missing))


def check_denm(message: Denm, ssp: bytes | None) -> None:
    """Check that the certificate with this SSP permits a DENM; the end of an event needs no bit.

    Raises:
        DecodeError: `not_permitted`.
    """
    situation = message.notification.situation
    if situation is None:
        return
    cause, bits = situation.event.cause, _bits(ssp)
    place = DENM_CAUSES.index(cause) if cause in DENM_CAUSES else len(DENM_CAUSES)
    octet = bits[place // 8 : place // 8 + 1] or b"\0"
    if not octet[0] & 0x80 >> place % 8:
        raise DecodeError("not_permitted", f"cause {cause}")


def _bits(ssp: bytes | None) -> bytes:
    """Return the octets after the version; none of a version that is not known."""
    return ssp[1:] if ssp and ssp[0] in _VERSIONS else b""


def _needed(message: Cam) -> Iterator[CamPermission]:
    """Yield what a CAM needs; a container of a later edition, which is not read, needs nothing."""
    parameters = message.parameters
    match parameters.high_frequency.value:
        case HighFrequency(tolling_zone=zone) | RoadSideContainer(zones=zone) if zone is not None:
            yield CamPermission.TOLLING_ZONE
    special = parameters.special_vehicle
    if special is None or not isinstance(special.name, str):
        return
    yield CamPermission[special.name.upper()]
    match special.value:
        case RoadWorks(closed_lanes=lanes) if lanes is not None:
            yield CamPermission.CLOSED_LANES
        case Emergency(priority=priority) if priority is not None:
            yield from (bit for asked, bit in _PRIORITIES.items() if asked in priority)
        case SafetyCar(rule=rule, speed_limit_m_s=limit_m_s):
            yield from (bit for given, bit in _RULES.items() if given is rule)
            if limit_m_s is not None:
                yield CamPermission.SPEED_LIMIT
