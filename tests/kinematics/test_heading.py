"""Which way the own car faces, from courses that are the worse the slower it drives."""

import math
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import assume, given
from hypothesis import strategies as st

from onboard.gnss.nmea import NmeaReader
from onboard.kinematics.heading import (
    CURVATURE_1_M,
    LATERAL_M_S2,
    MIN_COURSE_SPEED_M_S,
    Heading,
    HeadingFilter,
)
from onboard.observations import Position, YawRate

SIGMA_M_S, MOUNTING_RAD = 0.1, 0.02


def fix(at: float, speed_m_s: float | None, course_rad: float | None) -> Position:
    return Position(at, 48.0, 11.0, None, 0.7, speed_m_s, course_rad)


def after(fixes: Iterable[Position]) -> HeadingFilter:
    heading = HeadingFilter(SIGMA_M_S, MOUNTING_RAD)
    for each in fixes:
        heading.receive_position(each)
    return heading


def known(heading: HeadingFilter, at: float) -> Heading:
    found = heading.at(at)
    assert found is not None
    return found


def off_rad(found: Heading, truth_rad: float) -> float:
    return math.remainder(found.heading_rad - truth_rad, math.tau)


def drive(
    moments: Iterable[tuple[float, float, float]], rng: np.random.Generator
) -> Iterator[Position]:
    """What a receiver says of (at, speed, heading): velocities are off by as much at any speed."""
    for at, speed_m_s, heading_rad in moments:
        east_m_s, north_m_s = SIGMA_M_S * rng.standard_normal(2)
        east_m_s += speed_m_s * math.sin(heading_rad)
        north_m_s += speed_m_s * math.cos(heading_rad)
        yield fix(at, math.hypot(east_m_s, north_m_s), math.atan2(east_m_s, north_m_s))


def stop(
    from_m_s: float, braking_m_s2: float, heading_rad: float
) -> list[tuple[float, float, float]]:
    """Two seconds of driving, a stop and five seconds at a stand, ten fixes a second."""
    speeds = [from_m_s - braking_m_s2 * max(k / 10 - 2.0, 0.0) for k in range(70)]
    speeds = [max(speed, 0.0) for speed in speeds]
    return [(k / 10, speed, heading_rad) for k, speed in enumerate(speeds)]


# --- Standing ------------------------------------------------------------------------------------


def test_who_has_not_driven_yet_knows_no_heading() -> None:
    assert HeadingFilter(SIGMA_M_S, MOUNTING_RAD).at(0.0) is None
    assert after(fix(k / 10, 0.1, float(k)) for k in range(50)).at(5.0) is None


def test_who_stands_keeps_heading_and_certainty_for_as_long_as_he_stands() -> None:
    heading = after([fix(0.0, 10.0, 1.0), fix(0.1, 0.0, None)])
    stopped = known(heading, 0.1)

    for k in range(2, 6000):
        heading.receive_position(fix(k / 10, 0.0, float(k)))

    assert known(heading, 600.0) == stopped


def test_who_brakes_to_a_stand_keeps_what_the_better_courses_said() -> None:
    """The last course at 1.5 m/s, as receivers tell it, is off by 0.07 rad, and was held before."""
    rng = np.random.default_rng(1)
    ends = []
    for _ in range(300):
        truth = rng.uniform(-math.pi, math.pi)
        moments = stop(rng.uniform(5.0, 15.0), rng.uniform(1.5, 5.0), truth)
        end = known(after(drive(moments, rng)), 7.0)
        ends.append((off_rad(end, truth), end.sigma_rad))

    errors, sigmas = np.array(ends).T
    assert np.sqrt(np.mean(errors**2)) < 0.02
    assert np.mean(np.abs(errors) < 2.0 * sigmas) > 0.95
    assert np.median(sigmas) < 0.04


def test_who_crawls_farther_believes_the_new_courses() -> None:
    """Within 50 m at a walk the car may have turned: what was held has become the worse one."""
    start = [fix(k / 10, 10.0, 0.0) for k in range(20)]
    crawl = [fix(2.0 + k / 10, 1.2, 0.2) for k in range(400)]

    assert known(after(start + crawl[:3]), 2.3).heading_rad < 0.05
    assert known(after(start + crawl), 42.0).heading_rad == pytest.approx(0.2, abs=0.01)


# --- Driving -------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate_hz", [10, 5, 1])
def test_at_speed_it_is_as_certain_as_the_camera_is_mounted(rate_hz: int) -> None:
    fixes = [fix(k / rate_hz, 25.0, 3.0) for k in range(20)]

    assert known(after(fixes), fixes[-1].stamp_s).sigma_rad < 1.03 * MOUNTING_RAD


@pytest.mark.parametrize(("speed_m_s", "radius_m"), [(3.0, 7.0), (5.0, 10.0), (8.0, 20.0)])
def test_who_turns_is_followed(speed_m_s: float, radius_m: float) -> None:
    """Through a right angle at a junction: off by no more than it says, most of the time."""
    rng = np.random.default_rng(2)
    rate = speed_m_s / radius_m
    times = np.arange(0.0, 6.0 + math.pi / 2.0 / rate, 0.1)
    truths = np.clip((times - 3.0) * rate, 0.0, math.pi / 2.0)
    squares = []
    for _ in range(40):
        moments = [
            (at, speed_m_s, truth)
            for at, truth in zip(times.tolist(), truths.tolist(), strict=True)
        ]
        heading = HeadingFilter(SIGMA_M_S, MOUNTING_RAD)
        for said, (at, _, truth) in zip(drive(moments, rng), moments, strict=True):
            heading.receive_position(said)
            now = known(heading, at)
            squares.append((off_rad(now, truth) / now.sigma_rad) ** 2)

    assert np.mean(squares) < 2.0
    assert np.mean(np.array(squares) < 4.0) > 0.85


def test_a_course_that_contradicts_what_was_held_is_where_it_begins_anew() -> None:
    """As after a ferry, or out of a car park."""
    heading = after([fix(k / 10, 10.0, 0.0) for k in range(20)] + [fix(2.0, 10.0, 2.0)])

    assert known(heading, 2.0).heading_rad == 2.0
    assert known(heading, 2.0).sigma_rad == pytest.approx(math.hypot(0.01, 0.02))


def test_between_fixes_it_becomes_less_certain_by_the_way_that_is_driven() -> None:
    heading = after([fix(0.0, 5.0, 0.0)])
    sigmas = [known(heading, at).sigma_rad for at in (0.0, 0.3, 1.0, 60.0)]

    assert sigmas == sorted(sigmas)
    assert known(heading, -0.3).sigma_rad == sigmas[1]  # a picture from before the fix
    assert sigmas[-1] == pytest.approx(CURVATURE_1_M * math.sqrt(5.0 * 60.0), rel=0.01)


def test_a_long_tunnel_leaves_nothing_of_what_was_known() -> None:
    before, after_it = fix(0.0, 15.0, 0.0), fix(300.0, 15.0, 0.1)
    heading = after([before, after_it])

    assert known(heading, 300.0).heading_rad == pytest.approx(0.1, abs=0.001)


@pytest.mark.parametrize("said", [fix(1.0, None, 2.0), fix(1.0, 10.0, None)])
def test_a_fix_without_speed_or_course_changes_nothing_but_the_time(said: Position) -> None:
    one, other = after([fix(0.0, 10.0, 1.0)]), after([fix(0.0, 10.0, 1.0), said])

    assert known(other, 2.0).heading_rad == known(one, 2.0).heading_rad
    assert known(other, 2.0).sigma_rad == pytest.approx(known(one, 2.0).sigma_rad)


@pytest.mark.parametrize("sensor_error_rad_s", [-0.004, 0.004])
def test_a_yaw_rate_shows_a_slow_turn_before_the_courses_do(sensor_error_rad_s: float) -> None:
    """As a left turn of Euro NCAP at 10 km/h: by courses alone the heading is late."""
    rng = np.random.default_rng(3)
    speed_m_s, rate_rad_s = 2.8, -0.3
    times = np.arange(0.0, 8.0, 0.1).tolist()
    moments = [(at, speed_m_s, rate_rad_s * max(at - 5.0, 0.0)) for at in times]
    late: list[float] = []
    found: list[float] = []
    for _ in range(20):
        by_courses, by_both = (HeadingFilter(SIGMA_M_S, MOUNTING_RAD) for _ in range(2))
        for said, (at, _, truth_rad) in zip(drive(moments, rng), moments, strict=True):
            for step in range(5):
                turned = rate_rad_s if at > 4.99 else 0.0
                sample = YawRate(at + step / 50.0, turned + sensor_error_rad_s, "can")
                by_both.receive_yaw_rate(sample)
            for each, errors in ((by_courses, late), (by_both, found)):
                each.receive_position(said)
                if 5.5 <= at < 6.5:
                    errors.append(off_rad(known(each, at), truth_rad))

    late_rad, found_rad = (np.sqrt(np.mean(np.square(each))) for each in (late, found))
    assert found_rad < min(0.02, late_rad / 2.0)


def test_between_fixes_it_turns_as_the_yaw_rate_says_and_at_rest_it_does_not() -> None:
    driving, standing = (
        after([fix(0.0, 5.0, 1.0)]),
        after([fix(0.0, 5.0, 1.0), fix(0.1, 0.0, None)]),
    )
    for heading in (driving, standing):
        for k in range(40):
            heading.receive_yaw_rate(YawRate(k / 50, 0.3, "can"))

    assert off_rad(known(driving, 0.5), 1.15) == pytest.approx(0.0, abs=0.02)
    assert known(driving, 0.5).sigma_rad < known(after([fix(0.0, 5.0, 1.0)]), 0.5).sigma_rad
    assert known(standing, 0.5).heading_rad == pytest.approx(1.0, abs=0.005)
    gone = known(driving, 5.0)  # its samples are too old
    assert gone == known(after([fix(0.0, 5.0, 1.0)]), 5.0)


# --- Beside others -------------------------------------------------------------------------------

DRIVES = st.lists(st.tuples(st.floats(1.0, 40.0), st.floats(-0.01, 0.01)), min_size=2, max_size=30)
"""Speed and course less the one before, ten a second."""


def fixes_of(steps: list[tuple[float, float]], from_rad: float = 0.0) -> list[Position]:
    courses = from_rad + np.cumsum([turn for _, turn in steps])
    return [
        fix(k / 10, speed, float(course) % math.tau)
        for k, ((speed, _), course) in enumerate(zip(steps, courses, strict=True))
    ]


@given(DRIVES)
def test_it_is_the_kalman_filter_of_others(steps: list[tuple[float, float]]) -> None:
    fixes = fixes_of(steps, from_rad=3.0)
    oracle = KalmanFilter(dim_x=1, dim_z=1)
    oracle.F = oracle.H = np.eye(1)
    oracle.x, oracle.P = np.array([[3.0 + steps[0][1]]]), np.array([[(0.1 / steps[0][0]) ** 2]])
    for (slow, _), (speed, _), said in zip(steps, steps[1:], fixes[1:], strict=False):
        curvature = min(CURVATURE_1_M, LATERAL_M_S2 / min(slow, speed) ** 2)
        oracle.predict(Q=curvature**2 * 0.1 * max(slow, speed))
        noise = (0.1 / speed) ** 2
        assume((said.course_rad - oracle.x[0, 0]) ** 2 < 8.9 * (oracle.P[0, 0] + noise))
        oracle.update(said.course_rad, R=noise)

    ours = known(after(fixes), fixes[-1].stamp_s)

    assert off_rad(ours, oracle.x[0, 0]) == pytest.approx(0.0, abs=1e-9)
    assert ours.sigma_rad == pytest.approx(math.sqrt(oracle.P[0, 0] + 0.02**2), rel=1e-6)


@given(DRIVES, st.floats(0.0, math.tau))
def test_north_is_a_direction_like_any_other(
    steps: list[tuple[float, float]], from_rad: float
) -> None:
    at = (len(steps) - 1) / 10
    one, other = (known(after(fixes_of(steps, start)), at) for start in (0.0, from_rad))

    assert off_rad(other, one.heading_rad + from_rad) == pytest.approx(0.0, abs=1e-6)
    assert other.sigma_rad == pytest.approx(one.sigma_rad)


@pytest.mark.realdata
@pytest.mark.parametrize(("name", "least_share"), [("drive-a", 0.97), ("drive-c", 0.92)])
def test_on_a_real_drive_the_next_course_is_where_it_is_said_to_be(
    rig_data: Path, name: str, least_share: float
) -> None:
    """One fix a second, junctions included: within two sigma a second ahead, most of the time."""
    reader = NmeaReader()
    reader.receive_bytes((rig_data / "gnss" / f"{name}.nmea").read_bytes())
    heading, inside = HeadingFilter(SIGMA_M_S, MOUNTING_RAD), []
    while (event := reader.next_event()) is not None:
        if isinstance(event, Position):
            said, course_rad = heading.at(event.stamp_s), event.course_rad
            if said and course_rad is not None and (event.speed_m_s or 0.0) >= MIN_COURSE_SPEED_M_S:
                inside.append(abs(off_rad(said, course_rad)) < 2.0 * said.sigma_rad)
            heading.receive_position(event)

    assert len(inside) > 300
    assert np.mean(inside) > least_share
