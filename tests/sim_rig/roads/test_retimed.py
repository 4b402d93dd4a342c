"""Traces are checked for what no car can drive, and retimed so that a car can."""

from dataclasses import replace

import numpy as np
import pytest

from sim_rig.roads.drivability import Drivability, drivability
from sim_rig.roads.recording import STEP_S, RecordedTraffic, Trajectory
from sim_rig.roads.retimed import BRAKING_M_S2, GAINING_M_S2, LATERAL_M_S2, retimed


def driven(speed_m_s: list[float], name: str = "a", north_m: float = 0.0) -> Trajectory:
    """Return a car that drives east with these speeds, one each step."""
    speed = np.array(speed_m_s)
    east_m = np.concatenate([[0.0], np.cumsum(speed[:-1] * STEP_S)])
    middle_m = np.stack([east_m, np.full(len(speed), north_m)], axis=1)
    return Trajectory(name, 20, middle_m, np.zeros(len(speed)), speed, 4.5, 1.8)


STOPS = [15.0] * 100 + [0.0] * 60 + [15.0] * 100
"""Within a tenth of a second, as in the city trace."""


def test_a_trace_that_no_car_can_drive_is_found_out() -> None:
    calm = driven([10.0] * 50, "calm", north_m=20.0)
    found = drivability(RecordedTraffic([driven(STOPS), calm, replace(calm, name="same place")]))

    assert found == Drivability(1, 1, 1, 2, 3)
    assert not found.can_be_driven
    assert found.line("city").startswith("city: of 3 cars, 1 brake harder than 10 m/s^2, 1 gain")


def test_a_retimed_car_brakes_and_gains_speed_as_cars_do() -> None:
    recording = RecordedTraffic([driven(STOPS)])
    (drive,) = retimed(recording).drives
    gains_m_s2 = np.diff(drive.speed_m_s) / STEP_S

    assert drivability(retimed(recording)).can_be_driven
    assert gains_m_s2.min() == pytest.approx(-BRAKING_M_S2, abs=0.01)
    assert gains_m_s2.max() == pytest.approx(GAINING_M_S2, abs=0.01)
    assert drive.speed_m_s.max() == pytest.approx(15.0)


def test_a_retimed_car_stops_where_it_did_and_leaves_when_it_did() -> None:
    before, (drive,) = driven(STOPS), retimed(RecordedTraffic([driven(STOPS)])).drives
    stands = np.flatnonzero(drive.speed_m_s < 0.01)

    assert drive.middle_m[stands, 0] == pytest.approx(before.middle_m[120, 0], abs=0.02)
    assert drive.first + stands[-1] == pytest.approx(before.first + 159, abs=4)
    assert drive.middle_m[-1, 0] == pytest.approx(before.middle_m[-1, 0], abs=1.5)


def test_a_retimed_car_is_slow_in_a_bend() -> None:
    turn = np.linspace(0.0, np.pi / 2, 15)
    heading_rad = np.concatenate([np.zeros(60), turn, np.full(60, np.pi / 2)])
    speed = np.full(len(heading_rad), 12.0)
    steps_m = 1.2 * np.stack([np.cos(heading_rad), np.sin(heading_rad)], axis=1)
    middle_m = np.cumsum(steps_m, axis=0)
    car = Trajectory("a", 0, middle_m, heading_rad, speed, 4.5, 1.8)
    (drive,) = retimed(RecordedTraffic([car])).drives
    lateral_m_s2 = drive.speed_m_s[1:] * np.abs(np.diff(drive.heading_rad)) / STEP_S

    assert lateral_m_s2.max() <= LATERAL_M_S2 * 1.1
    assert drive.speed_m_s.min() < 8.0
