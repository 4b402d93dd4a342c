"""BSMs to CAMs and back: the same vehicle, with the CAM's reference point, signs and units."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench._messages import bsm as example
from onboard.its_g5.awareness import bsm_of, cam_of
from onboard.kinematics.geodesy import distance_m
from onboard.messages import cam
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import (
    ALL_WHEELS,
    AccelerationSet,
    BrakeSystemStatus,
    CoreData,
    WheelBrakes,
)
from onboard.messages.bsm_safety import ExteriorLights, VehicleEventFlags, VehicleSafetyExtensions
from onboard.messages.cam_special import RoadSideContainer
from onboard.messages.fields import Chosen
from tests.tools.test_decode_its import CAMS

UTC_S = 1_790_000_000.2
SENT = example(0, 1, 3)


def received(message: BasicSafetyMessage, utc_s: float = UTC_S) -> BasicSafetyMessage:
    """The vehicle as its CAM tells it, 20 ms later."""
    data = cam.encode(cam_of(message, utc_s, low_frequency=True))
    found = bsm_of(cam.decode(data), utc_s + 0.02)
    assert found is not None
    return found


@given(st.floats(0.0, math.tau - 1e-3), st.floats(UTC_S, UTC_S + 200.0), st.floats(0.0, 1.0))
def test_a_vehicle_is_where_and_when_it_was(heading: float, utc_s: float, age_s: float) -> None:
    sec_mark_s = round((utc_s - age_s) * 1e3) % 60_000 / 1e3
    core = replace(SENT.core, heading_rad=heading, sec_mark_s=sec_mark_s)
    there = received(replace(SENT, core=core), utc_s).core
    apart_m = distance_m(there.latitude_deg or 0.0, there.longitude_deg or 0.0, 25.0330, 121.5654)
    assert apart_m < 0.05
    assert abs(math.remainder((there.sec_mark_s or 0.0) - sec_mark_s, 60.0)) < 0.0021
    assert there.speed_m_s == pytest.approx(13.9)
    assert abs(math.remainder((there.heading_rad or 0.0) - heading, math.tau)) < 1e-3
    assert there.accuracy.semi_major_m == pytest.approx(1.5, abs=0.003)
    assert (there.size.length_m, there.size.width_m) == (4.5, 1.8)
    assert there.elevation_m == 12.0


def test_a_cam_names_the_middle_of_the_front() -> None:
    position = cam_of(SENT, UTC_S, low_frequency=False).parameters.basic.position
    ahead_m = distance_m(
        25.0330, 121.5654, position.latitude_deg or 0.0, position.longitude_deg or 0.0
    )
    assert ahead_m == pytest.approx(4.5 / 2)


def test_what_turns_is_positive_to_the_left_in_a_cam() -> None:
    core = replace(SENT.core, acceleration=AccelerationSet(-0.4, 0.1, None, 0.02))
    sent = cam_of(replace(SENT, core=core), UTC_S, low_frequency=False)
    high = sent.parameters.high_frequency.value
    assert (high.yaw_rate.yaw_rate_rad_s, high.lateral.acceleration_m_s2) == (-0.02, -0.1)
    there = received(replace(SENT, core=core)).core.acceleration
    assert there.longitudinal_m_s2 == -0.4
    assert there.lateral_m_s2 == 0.1
    assert there.yaw_rate_rad_s == pytest.approx(0.02, abs=1e-4)


def test_the_path_history_is_that_of_the_bsm() -> None:
    assert SENT.safety is not None
    there = received(SENT).safety
    assert there is not None
    points = SENT.safety.path_history.crumb_data if SENT.safety.path_history else ()
    again = there.path_history.crumb_data if there.path_history else ()
    assert len(again) == len(points) == 5
    for one, other in zip(points, again, strict=True):
        assert other.latitude_offset_deg == pytest.approx(one.latitude_offset_deg, abs=5e-7)
        assert other.longitude_offset_deg == pytest.approx(one.longitude_offset_deg, abs=5e-7)
        assert other.age_s == pytest.approx(one.age_s, abs=0.01)


def test_a_recorded_path_leads_back_along_the_way_of_its_car() -> None:
    """Its points are 20 m apart, 1.6 s at 12 m/s: each is an offset from the one before."""
    there = bsm_of(cam.decode(CAMS[0]), UTC_S)
    assert there is not None
    assert there.safety is not None
    assert there.safety.path_history is not None
    assert there.core.heading_rad is not None
    for point in there.safety.path_history.crumb_data[1:]:
        assert point.age_s is not None
        north_deg, east_deg = point.latitude_offset_deg or 0.0, point.longitude_offset_deg or 0.0
        away_m = distance_m(53.63, 10.01, 53.63 + north_deg, 10.01 + east_deg)
        assert away_m == pytest.approx(12.5 * point.age_s, rel=0.2)


def test_lights_and_brakes_are_those_of_the_bsm() -> None:
    for lights in (
        ExteriorLights.LEFT_TURN_SIGNAL,
        ExteriorLights.HAZARD_SIGNAL,
        ExteriorLights.LOW_BEAM | ExteriorLights.RIGHT_TURN_SIGNAL,
    ):
        safety = VehicleSafetyExtensions(VehicleEventFlags.HARD_BRAKING, None, None, lights)
        there = received(BasicSafetyMessage(SENT.core, safety))
        assert there.safety == replace(safety, events=None), "events are in DENMs"
        assert there.core.brakes.wheel_brakes == ALL_WHEELS
    released = replace(SENT.core, brakes=BrakeSystemStatus(WheelBrakes(0)))
    assert received(BasicSafetyMessage(released)).core.brakes == released.brakes


def test_an_emergency_brake_in_a_cam_is_hard_braking() -> None:
    message = cam_of(SENT, UTC_S, low_frequency=False)
    control = cam.AccelerationControl.EMERGENCY_BRAKE
    vehicle = replace(message.parameters.high_frequency.value, acceleration_control=control)
    high = Chosen(cam.VEHICLE, vehicle)
    there = bsm_of(
        replace(message, parameters=replace(message.parameters, high_frequency=high)), UTC_S
    )
    assert there is not None
    assert there.safety is not None
    assert there.safety.events is VehicleEventFlags.HARD_BRAKING


def test_what_is_not_known_stays_so() -> None:
    silent = CoreData(0, b"abcd", sec_mark_s=SENT.core.sec_mark_s)
    there = received(BasicSafetyMessage(silent))
    assert replace(there.core, sec_mark_s=silent.sec_mark_s) == silent


def test_a_road_side_unit_is_no_vehicle() -> None:
    message = cam_of(SENT, UTC_S, low_frequency=False)
    high = Chosen(cam.ROAD_SIDE_UNIT, RoadSideContainer())
    unit = replace(message, parameters=replace(message.parameters, high_frequency=high))
    assert bsm_of(unit, UTC_S) is None
