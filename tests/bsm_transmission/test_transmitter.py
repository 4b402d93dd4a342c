"""The host vehicle's BSM, composed from its sensors."""

import numpy as np
import pytest
from typing_extensions import override

from onboard.bsm_transmission.transmitter import BsmTransmitter
from onboard.kinematics.units import KM_H
from onboard.messages import bsm
from onboard.messages.bsm_core import ALL_WHEELS, CoreData, VehicleSize, WheelBrakes
from onboard.messages.bsm_safety import ExteriorLights, VehicleEventFlags
from onboard.observations import (
    BrakeCause,
    BrakePedal,
    HardBrake,
    Position,
    Side,
    Speed,
    TurnSignal,
)
from onboard.security.pseudonyms import Pseudonym
from onboard.sensors.host_state import HostState

SIDES: tuple[Side, ...] = ("left", "right")
WHO = Pseudonym(bytes(8), b"abcd", 5, None, 300.0)


class Beacon(BsmTransmitter):
    """A transmitter whose host vehicle's sensors give what it receives."""

    def __init__(self) -> None:
        self.host = HostState()
        super().__init__(VehicleSize(1.8, 4.5), WHO, np.random.default_rng(1), 0.0, self.host)

    @override
    def receive_speed(self, speed: Speed) -> None:
        self.host.receive_observation(speed)
        super().receive_speed(speed)

    @override
    def receive_position(self, position: Position) -> None:
        self.host.receive_observation(position)
        super().receive_position(position)


@pytest.fixture
def beacon() -> Beacon:
    return Beacon()


def core(beacon: Beacon, now: float) -> CoreData:
    return beacon.bsm(None, now, now).core


@pytest.mark.parametrize("deceleration_m_s2", [-2.0, 0.0, 4.0, 8.0])
def test_the_acceleration_follows_from_speeds_in_whole_km_h(
    beacon: Beacon, deceleration_m_s2: float
) -> None:
    for i in range(21):
        speed_m_s = round((20.0 - deceleration_m_s2 * i / 20) / KM_H) * KM_H
        beacon.receive_speed(Speed(i / 20, speed_m_s, KM_H, "obd:7E8"))

    said = core(beacon, 1.0).acceleration.longitudinal_m_s2

    assert said == pytest.approx(-deceleration_m_s2, abs=0.35)


@pytest.mark.parametrize(("fix_at_s", "speed_m_s"), [(0.8, 20.0), (0.7, 14.0), (-0.7, 14.0)])
def test_the_speed_is_that_of_a_fresh_fix_and_else_that_of_the_bus(
    beacon: Beacon, fix_at_s: float, speed_m_s: float
) -> None:
    beacon.receive_position(Position(fix_at_s, 48.0, 11.0, None, 1.0, 20.0, 0.0))
    beacon.receive_speed(Speed(0.95, 14.0, KM_H, "obd:7E8"))

    assert core(beacon, 1.0).speed_m_s == speed_m_s


@pytest.mark.parametrize(
    ("speed_m_s", "held_rad", "said_rad"),
    [(10.0, 0.5, 2.0), (0.3, 0.5, 0.5), (0.3, None, None), (None, 0.5, 2.0)],
)
def test_at_standstill_the_held_heading_is_sent_instead_of_the_course(
    beacon: Beacon, speed_m_s: float | None, held_rad: float | None, said_rad: float | None
) -> None:
    """At standstill the course of a receiver is random."""
    beacon.receive_position(Position(1.0, 48.0, 11.0, None, 1.0, speed_m_s, 2.0))

    assert beacon.bsm(None, 1.0, 1.0, held_rad).core.heading_rad == said_rad


@pytest.mark.parametrize(
    ("utc_s", "sec_mark_s"),
    [(59.9994, 59.999), (59.9996, 0.0), (120.0, 0.0), (1_700_000_099.9999, 0.0)],
)
def test_sec_mark_at_the_end_of_a_minute_is_not_a_leap_second(
    beacon: Beacon, utc_s: float, sec_mark_s: float
) -> None:
    said = bsm.decode(bsm.encode(beacon.bsm(None, 1.0, utc_s))).core

    assert said.sec_mark_s == pytest.approx(sec_mark_s)


def test_a_new_pseudonym_does_not_say_where_the_old_one_drove(beacon: Beacon) -> None:
    def drive(from_s: float, until_s: float) -> None:
        for now in np.arange(from_s, until_s, 0.1):
            north_deg = 48.0 + 20.0 * now / 111_195
            beacon.receive_position(Position(now, north_deg, 11.0, None, 1.0, 20.0, 0.0))

    def history_s() -> float:
        safety = beacon.bsm(None, beacon_now, beacon_now).safety
        history = None if safety is None else safety.path_history
        return (
            max((each.age_s or 0.0 for each in history.crumb_data), default=0.0) if history else 0.0
        )

    beacon_now = 20.0
    drive(0.0, beacon_now)
    assert history_s() > 10.0
    beacon.change_identity(Pseudonym(bytes(8), b"efgh", 6, None, 600.0), beacon_now)
    assert history_s() == 0.0
    beacon_now = 25.0
    drive(20.0, beacon_now)
    assert history_s() <= 5.1


def test_missing_sensor_values_are_sent_as_unavailable(beacon: Beacon) -> None:
    said = core(beacon, 1.0)

    assert said.speed_m_s is None
    assert said.acceleration.longitudinal_m_s2 is None
    assert said.brakes.wheel_brakes == WheelBrakes.UNAVAILABLE


def test_two_speeds_give_no_acceleration(beacon: Beacon) -> None:
    for stamp_s in (0.0, 0.5):
        beacon.receive_speed(Speed(stamp_s, 20.0, KM_H, "obd:7E8"))

    assert core(beacon, 0.6).acceleration.longitudinal_m_s2 is None


@pytest.mark.parametrize(("pressed", "wheels"), [(True, ALL_WHEELS), (False, WheelBrakes(0))])
def test_the_brake_pedal_is_sent_if_the_bus_has_a_signal_for_it(
    beacon: Beacon, pressed: bool, wheels: WheelBrakes
) -> None:
    beacon.host.receive_observation(BrakePedal(0.9, pressed, "dbc"))

    assert core(beacon, 1.0).brakes.wheel_brakes == wheels
    assert core(beacon, 9.0).brakes.wheel_brakes == WheelBrakes.UNAVAILABLE


def flags(beacon: Beacon, now: float) -> VehicleEventFlags | None:
    safety = beacon.bsm(None, now, now).safety
    return safety.events if safety is not None else None


def test_the_hard_braking_flag_is_sent_as_long_as_the_braking_lasts(
    beacon: Beacon,
) -> None:
    assert beacon.take_due(1.0)
    assert not beacon.take_due(1.01)
    beacon.receive_hard_brake(HardBrake(1.01, 6.0, "obd:7E8"), 1.01)
    assert beacon.take_due(1.01)
    assert flags(beacon, 5.0) == VehicleEventFlags.HARD_BRAKING

    beacon.receive_hard_brake(HardBrake(5.1, 0.0, "obd:7E8", is_over=True), 5.1)
    assert flags(beacon, 5.2) is None


@pytest.mark.parametrize(
    ("cause", "flag"),
    [
        (BrakeCause.DECELERATION, VehicleEventFlags(0)),
        (BrakeCause.BRAKE_PRESSURE, VehicleEventFlags(0)),
        (BrakeCause.COLLISION, VehicleEventFlags(0)),
        (BrakeCause.HAZARD_LIGHTS, VehicleEventFlags.HAZARD_LIGHTS),
        (BrakeCause.STABILITY_CONTROL, VehicleEventFlags.STABILITY_CONTROL_ACTIVATED),
        (BrakeCause.ABS, VehicleEventFlags.ABS_ACTIVATED),
        (BrakeCause.AIRBAG, VehicleEventFlags.AIR_BAG_DEPLOYMENT),
    ],
)
def test_each_cause_has_its_flag_beside_that_of_hard_braking(
    beacon: Beacon, cause: BrakeCause, flag: VehicleEventFlags
) -> None:
    beacon.receive_hard_brake(HardBrake(1.0, 6.0, "dbc", cause), 1.0)
    assert flags(beacon, 1.0) == flag | VehicleEventFlags.HARD_BRAKING

    beacon.receive_hard_brake(HardBrake(1.5, 2.0, "dbc", cause), 1.5)
    assert flags(beacon, 1.5) == (flag or None)


def test_an_airbag_outlasts_the_hard_braking_at_standstill(beacon: Beacon) -> None:
    beacon.receive_hard_brake(HardBrake(1.0, 90.0, "dbc", BrakeCause.AIRBAG), 1.0)
    for tenth in range(100):
        beacon.receive_speed(Speed(1.0 + tenth / 10, 0.0, KM_H, "obd:7E8"))

    assert flags(beacon, 2.0) == (
        VehicleEventFlags.AIR_BAG_DEPLOYMENT | VehicleEventFlags.HARD_BRAKING
    )
    assert flags(beacon, 3.0) == VehicleEventFlags.AIR_BAG_DEPLOYMENT


def test_the_button_sets_no_flag_and_ends_none(beacon: Beacon) -> None:
    button = HardBrake(1.0, 4.0, "button", BrakeCause.TEST)
    beacon.receive_hard_brake(button, 1.0)
    assert flags(beacon, 1.0) is None

    beacon.receive_hard_brake(HardBrake(2.0, 6.0, "obd:7E8"), 2.0)
    beacon.receive_hard_brake(button, 2.1)
    assert flags(beacon, 2.2) == VehicleEventFlags.HARD_BRAKING


@pytest.mark.parametrize(
    ("on", "lights"),
    [
        ((), None),
        (("left",), ExteriorLights.LEFT_TURN_SIGNAL),
        (("right",), ExteriorLights.RIGHT_TURN_SIGNAL),
        (("left", "right"), ExteriorLights.HAZARD_SIGNAL),
    ],
)
def test_a_turn_signal_is_sent_while_it_blinks(
    beacon: Beacon, on: tuple[Side, ...], lights: ExteriorLights | None
) -> None:
    for half_period in range(6):
        for side in SIDES:
            is_on = side in on and half_period % 2 == 0
            beacon.host.receive_observation(TurnSignal(0.4 * half_period, side, is_on, "dbc"))
        now = 0.4 * half_period + 0.3
        safety = bsm.decode(bsm.encode(beacon.bsm(None, now, now))).safety
        assert (safety and safety.lights) == lights

    assert beacon.bsm(None, 2.7, 2.7).safety is None, "it is off, or the bus is silent"
