"""A yaw rate or steering angle that turns otherwise than the vehicle is found and dropped."""

import math
from collections.abc import Callable, Mapping

import numpy as np
import pytest

from onboard.observations import Discarded, Position, Sensor, Speed, Steering, YawRate
from onboard.sensors.host_sensors import HostSensors

Course = Callable[[float], float]
"""The true yaw rate in rad/s at a time in s."""


def bend(radius_m: float, speed_m_s: float) -> Course:
    return lambda at_s: speed_m_s / radius_m if at_s >= 10.0 else 0.0


def straight(_at_s: float) -> float:
    return 0.0


def town(at_s: float) -> float:
    """Turns at crossings, and between them a little to either side."""
    return 0.3 if at_s % 15.0 < 5.0 else 0.02 * math.sin(at_s)


class Drive:
    """A drive with sensors that are right or wrong, at 10 Hz."""

    def __init__(self, course: Course, speed_m_s: float, *, gnss: bool = True) -> None:
        self.course, self.speed_m_s, self.gnss = course, speed_m_s, gnss
        self.yaw_rate: Course = course
        self.steering: Course | None = None
        self.rng = np.random.default_rng(1)

    def used(self, until_s: float = 40.0) -> tuple[dict[str, list[float]], list[Discarded]]:
        """Times at which each kind of sample is used, and what is reported."""
        sensors = HostSensors({Sensor.SPEED: 1.0}, 0.0)
        used: dict[str, list[float]] = {"yaw_rate": [], "steering": []}
        heading = 0.0
        for at_s in np.arange(0.0, until_s, 0.1).tolist():
            heading += 0.1 * self.course(at_s)
            course = (heading + 0.1 / self.speed_m_s * self.rng.standard_normal()) % math.tau
            sensors.receive_observation(Speed(at_s, self.speed_m_s, 0.28, "obd:7E8"), at_s)
            if self.gnss:
                fix = Position(at_s, 48.0, 11.0, None, 1.0, self.speed_m_s, course)
                sensors.receive_observation(fix, at_s)
            turns: list[YawRate | Steering] = [YawRate(at_s, self.yaw_rate(at_s), "dbc:A.B")]
            if self.steering is not None:
                turns.append(Steering(at_s, self.steering(at_s) / self.speed_m_s, "dbc:C.D"))
            for turn in turns:
                if sensors.receive_observation(turn, at_s):
                    used[turn.kind].append(at_s)
        events = list(iter(sensors.next_event, None))
        return used, [event for event in events if isinstance(event, Discarded)]


WRONG: Mapping[str, Callable[[Course], Course]] = {
    "wrong sign": lambda course: lambda at_s: -course(at_s),
    "frozen at zero": lambda _: straight,
    "wrong scale": lambda course: lambda at_s: 4.0 * course(at_s),
}


@pytest.mark.parametrize("name", WRONG)
@pytest.mark.parametrize(
    ("radius_m", "speed_m_s"), [(150.0, 16.0), (-300.0, 22.0), (600.0, 28.0), (-1000.0, 30.0)]
)
def test_a_wrong_yaw_rate_is_found_in_the_first_seconds_of_a_bend(
    name: str, radius_m: float, speed_m_s: float
) -> None:
    drive = Drive(bend(radius_m, speed_m_s), speed_m_s)
    drive.yaw_rate = WRONG[name](drive.course)

    used, discarded = drive.used()

    assert not [at_s for at_s in used["yaw_rate"] if at_s > 3.0]  # before courses are known
    assert [(each.component, each.reason) for each in discarded] == [("obd", "contradicted")]
    assert discarded[0].detail == "yaw_rate by dbc:A.B"


def test_a_yaw_rate_that_freezes_in_a_bend_is_found_on_the_straight_road_after_it() -> None:
    def course(at_s: float) -> float:
        return 0.05 if at_s < 10.0 else 0.0

    drive = Drive(course, 28.0)
    drive.yaw_rate = lambda _: 0.05

    used, _ = drive.used()

    assert max(used["yaw_rate"]) < 18.0


@pytest.mark.parametrize(
    ("course", "speed_m_s"),
    [(bend(150.0, 16.0), 16.0), (bend(600.0, 28.0), 28.0), (town, 8.0)],
)
def test_right_sensors_with_an_offset_are_used_from_the_first_bend_on(
    course: Course, speed_m_s: float
) -> None:
    drive = Drive(course, speed_m_s)
    drive.yaw_rate = lambda at_s: course(at_s - 0.1) + 0.005
    drive.steering = lambda at_s: 1.15 * course(at_s)

    used, discarded = drive.used()

    assert discarded == []
    for stamps in used.values():
        assert len([at_s for at_s in stamps if at_s >= 14.0]) == 260


def test_on_a_straight_road_with_courses_no_sensor_is_used_and_none_reported() -> None:
    used, discarded = Drive(straight, 30.0).used()

    assert not [at_s for at_s in used["yaw_rate"] if at_s > 3.0]
    assert discarded == []


def test_a_sensor_that_is_right_again_is_believed_after_the_next_bend() -> None:
    drive = Drive(town, 8.0)
    drive.yaw_rate = lambda at_s: -town(at_s) if at_s < 20.0 else town(at_s)

    used, discarded = drive.used(60.0)

    assert len(discarded) == 1
    assert not [at_s for at_s in used["yaw_rate"] if 10.0 < at_s < 20.0]
    assert used["yaw_rate"][-1] == pytest.approx(59.9)


def test_without_courses_two_sensors_that_differ_are_both_dropped() -> None:
    drive = Drive(bend(300.0, 22.0), 22.0, gnss=False)
    drive.yaw_rate = WRONG["wrong sign"](drive.course)
    drive.steering = drive.course

    used, discarded = drive.used()

    assert max(used["yaw_rate"]) < 18.0
    assert max(used["steering"]) < 18.0
    assert len(discarded) == 2


def test_a_sensor_without_another_is_believed() -> None:
    used, discarded = Drive(bend(300.0, 22.0), 22.0, gnss=False).used()

    assert (len(used["yaw_rate"]), discarded) == (400, [])
