"""Cars that were recorded one by one follow each other and give way; nobody else is changed."""

from dataclasses import replace

import numpy as np
import pytest

from sim_rig.roads.drivability import drivability
from sim_rig.roads.following import following
from sim_rig.roads.recording import STEP_S, RecordedTraffic, Trajectory


def driven(name: str, speed_m_s: list[float], east_m: float, north_m: float = 0.0) -> Trajectory:
    """Return a car that drives east from here with these speeds, one each step."""
    speed = np.array(speed_m_s)
    ways_m = east_m + np.concatenate([[0.0], np.cumsum(speed[:-1] * STEP_S)])
    middle_m = np.stack([ways_m, np.full(len(speed), north_m)], axis=1)
    return Trajectory(name, 0, middle_m, np.zeros(len(speed)), speed, 4.5, 1.8)


SLOW, FAST = [5.0] * 400, [15.0] * 133


def test_a_faster_car_keeps_behind_the_one_that_it_was_recorded_to_drive_through() -> None:
    recording = RecordedTraffic([driven("slow", SLOW, 60.0), driven("fast", FAST, 0.0)])
    assert drivability(recording).overlap == 2

    traffic = following(recording)

    assert drivability(traffic).can_be_driven
    slow, fast = traffic.drive("slow"), traffic.drive("fast")
    shared = min(len(slow), len(fast))
    gaps_m = slow.middle_m[:shared, 0] - fast.middle_m[:shared, 0] - 4.5
    assert gaps_m.min() >= 1.0


def test_cars_of_other_lanes_and_of_the_other_direction_drive_as_recorded() -> None:
    beside = driven("beside", FAST, 0.0, north_m=3.5)
    oncoming = driven("oncoming", FAST, 0.0, north_m=-3.5)
    oncoming = replace(
        oncoming, middle_m=oncoming.middle_m[::-1], heading_rad=oncoming.heading_rad + np.pi
    )
    recording = RecordedTraffic([driven("slow", SLOW, 60.0), beside, oncoming])

    assert all(drive in recording.drives for drive in following(recording).drives)


def turned(drive: Trajectory, by_rad: float) -> Trajectory:
    """Turn a drive about the origin."""
    cosine, sine = np.cos(by_rad), np.sin(by_rad)
    middle_m = drive.middle_m @ np.array([[cosine, sine], [-sine, cosine]])
    return replace(drive, middle_m=middle_m, heading_rad=drive.heading_rad + by_rad)


def hardest_braking_m_s2(traffic: RecordedTraffic) -> float:
    """Return the strongest deceleration of all cars."""
    return -min(float(np.diff(drive.speed_m_s).min()) for drive in traffic.drives) / STEP_S


def test_who_comes_later_to_a_crossing_lets_the_other_pass_and_brakes_gently() -> None:
    first = driven("first", FAST, -75.0)
    later = turned(driven("later", FAST, -77.0), np.pi / 2)
    recording = RecordedTraffic([first, later])
    assert drivability(recording).overlap == 2

    traffic = following(recording)

    assert drivability(traffic).can_be_driven
    assert traffic.drive("first") is first
    assert 0.5 < hardest_braking_m_s2(traffic) < 4.0
    assert traffic.drive("later").middle_m[-1] == pytest.approx(later.middle_m[-1], abs=1.6)


def test_where_roads_join_the_later_one_begins_to_brake_before_the_other_is_on_its_path() -> None:
    joins = driven("joins", FAST, -75.0)
    heading_rad = -np.pi / 4 * np.clip((40.0 - np.arange(133)) / 10.0, 0.0, 1.0)
    middle_m = np.cumsum(1.5 * np.stack([np.cos(heading_rad), np.sin(heading_rad)], axis=1), axis=0)
    middle_m += joins.middle_m[60] + np.array([-3.0, 0.0]) - middle_m[60]
    other = Trajectory("other", 0, middle_m, heading_rad, np.full(133, 15.0), 4.5, 1.8)
    recording = RecordedTraffic([joins, other])
    assert drivability(recording).overlap == 2

    traffic = following(recording)

    assert drivability(traffic).can_be_driven
    assert hardest_braking_m_s2(traffic) < 5.0


def test_who_stands_at_a_stop_does_not_hold_up_those_that_cross() -> None:
    stands = driven("stands", [15.0] * 30 + [0.0] * 60 + [15.0] * 60, -75.0)
    crosses = turned(driven("crosses", FAST, -77.0), np.pi / 2)

    traffic = following(RecordedTraffic([stands, crosses]))

    assert traffic.drive("crosses") is crosses
