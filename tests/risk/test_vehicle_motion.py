"""Change of speed and course, from velocities."""

import math

import pytest

from onboard.risk.vehicle_motion import VehicleMotion


def after(turning_rad_s: float, acceleration_m_s2: float, course_rad: float) -> VehicleMotion:
    """A second at 10 Hz, at the end of which the car drives 10 m/s on `course_rad`."""
    motion = VehicleMotion(0.8)
    for k in range(11):
        left_s = 1.0 - k / 10
        speed_m_s = 10.0 - acceleration_m_s2 * left_s
        course = course_rad - turning_rad_s * left_s
        motion.receive_velocity(
            k / 10, k / 10, speed_m_s * math.cos(course), speed_m_s * math.sin(course)
        )
    return motion


@pytest.mark.parametrize("course_rad", [0.0, 2.0, 3.2, -1.5])
@pytest.mark.parametrize("turning_rad_s", [-0.3, 0.0, 0.1])
@pytest.mark.parametrize("acceleration_m_s2", [-3.0, 0.0, 1.0])
def test_a_turn_and_a_braking_are_distinguished(
    turning_rad_s: float, acceleration_m_s2: float, course_rad: float
) -> None:
    motion = after(turning_rad_s, acceleration_m_s2, course_rad)

    assert motion.acceleration_m_s2 == pytest.approx(acceleration_m_s2)
    assert motion.lateral_m_s2 == pytest.approx(10.0 * turning_rad_s, rel=0.25, abs=0.1)


def test_nothing_is_estimated_before_half_the_window_is_covered_or_at_standstill() -> None:
    motion = VehicleMotion(0.8)
    for k in range(4):
        motion.receive_velocity(k / 10, k / 10, 10.0, 0.0)
        assert motion.acceleration_m_s2 is None
        assert motion.lateral_m_s2 is None
    for k in range(4, 20):
        motion.receive_velocity(k / 10, k / 10, 0.0, 0.0)
    assert motion.lateral_m_s2 is None
