"""SSPs of CAMs and DENMs: what a certificate does not permit is refused."""

from dataclasses import replace
from typing import Any

import pytest

from onboard.errors import DecodeError
from onboard.its_g5.awareness import cam_of
from onboard.its_g5.permissions import (
    DENM_CAUSES,
    CamPermission,
    cam_ssp,
    check_cam,
    check_denm,
    denm_ssp,
)
from onboard.messages.cam import Cam
from onboard.messages.cam_special import (
    ClosedLanes,
    Emergency,
    EmergencyPriority,
    Rescue,
    RoadWorks,
    SafetyCar,
    TrafficRule,
)
from onboard.messages.denm import Denm, ReportedEvent
from onboard.messages.fields import Chosen
from onboard.messages.its_common import CauseCode, LightBarSiren
from tests.its_g5.test_awareness import SENT, UTC_S
from tests.its_g5.test_notification import braking

LIGHTS = LightBarSiren(0)
P = CamPermission


def cam(name: str | int | None, value: Any = None) -> Cam:
    plain = cam_of(SENT, UTC_S, low_frequency=True)
    special = None if name is None else Chosen(name, value)
    return replace(plain, parameters=replace(plain.parameters, special_vehicle=special))


def denm(cause: int) -> Denm:
    sent = braking()
    situation = ReportedEvent(4, CauseCode(cause))
    return replace(sent, notification=replace(sent.notification, situation=situation))


@pytest.mark.parametrize(
    ("message", "needed"),
    [
        (cam("rescue", Rescue(LIGHTS)), P.RESCUE),
        (cam("emergency", Emergency(LIGHTS)), P.EMERGENCY),
        (
            cam("emergency", Emergency(LIGHTS, priority=EmergencyPriority(3))),
            P.EMERGENCY | P.RIGHT_OF_WAY | P.FREE_CROSSING_AT_SIGNAL,
        ),
        (cam("road_works", RoadWorks(1, LIGHTS, ClosedLanes())), P.ROAD_WORKS | P.CLOSED_LANES),
        (
            cam("safety_car", SafetyCar(LIGHTS, None, TrafficRule.NO_PASSING, 20.0)),
            P.SAFETY_CAR | P.NO_PASSING | P.SPEED_LIMIT,
        ),
    ],
)
def test_each_container_and_right_of_a_cam_needs_its_bit(
    message: Cam, needed: CamPermission
) -> None:
    check_cam(message, cam_ssp(needed))
    for each in needed:
        with pytest.raises(DecodeError, match="not_permitted"):
            check_cam(message, cam_ssp(~each & CamPermission(0xFFFC)))


@pytest.mark.parametrize("ssp", [None, b"", b"\1", b"\1\0", b"\1\0\0", b"\7\xff\xff"])
def test_without_permissions_a_cam_is_that_of_an_ordinary_car(ssp: bytes | None) -> None:
    check_cam(cam(None), ssp)
    check_cam(cam(7, b"later edition"), ssp)
    with pytest.raises(DecodeError, match="not_permitted"):
        check_cam(cam("emergency", Emergency(LIGHTS)), ssp)


def test_the_bits_are_those_of_the_standards() -> None:
    """Emergency is bit 6 of octet 1 of a CAM's; cause 99 the last bit of a DENM's."""
    assert cam_ssp(P.EMERGENCY) == bytes.fromhex("010200")
    assert cam_ssp(P.TOLLING_ZONE | P.CLOSED_LANES) == bytes.fromhex("018080")
    assert denm_ssp((1,)) == bytes.fromhex("01800000")
    assert denm_ssp((99,)) == bytes.fromhex("01000001")
    assert denm_ssp() == bytes.fromhex("01000021")


@pytest.mark.parametrize("cause", DENM_CAUSES[:24])
def test_a_denm_needs_the_bit_of_its_cause(cause: int) -> None:
    check_denm(denm(cause), denm_ssp((cause,)))
    others = tuple(each for each in DENM_CAUSES[:24] if each != cause)
    for ssp in (denm_ssp(others), None, b"\1", b"\7\xff\xff\xff"):
        with pytest.raises(DecodeError, match=f"not_permitted.*{cause}"):
            check_denm(denm(cause), ssp)


def test_a_cause_without_a_bit_is_permitted_to_nobody_and_an_end_to_all() -> None:
    with pytest.raises(DecodeError, match="not_permitted"):
        check_denm(denm(200), b"\1\xff\xff\xff")
    with pytest.raises(DecodeError, match="not_permitted"):
        check_denm(denm(5), b"\1\xff\xff\xff")
    check_denm(denm(5), bytes.fromhex("0200000080"))
    ended = braking()
    check_denm(replace(ended, notification=replace(ended.notification, situation=None)), None)
