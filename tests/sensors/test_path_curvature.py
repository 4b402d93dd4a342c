"""The curvature of the own path, from each sensor that measures how the vehicle turns."""

import math
from collections.abc import Callable, Iterator, Mapping

import numpy as np
import pytest

from onboard.observations import Position, Speed, Steering, YawRate
from onboard.sensors.path_curvature import PathCurvature

SPEED_M_S = 20.0
Sample = Speed | YawRate | Steering | Position


def yaw_rate(at_s: float, curvature_1_m: float) -> Sample:
    return YawRate(at_s, curvature_1_m * SPEED_M_S, "dbc")


def steering(at_s: float, curvature_1_m: float) -> Sample:
    return Steering(at_s, curvature_1_m, "dbc")


def fix(at_s: float, curvature_1_m: float) -> Sample:
    course_rad = (0.1 + curvature_1_m * SPEED_M_S * at_s) % math.tau
    return Position(at_s, 48.0, 11.0, None, 1.0, SPEED_M_S, course_rad)


SOURCES: Mapping[str, Callable[[float, float], Sample]] = {
    "yaw rate": yaw_rate,
    "steering": steering,
    "GNSS": fix,
}


def driven(*sources: Callable[[float], Sample], until_s: float = 5.0) -> PathCurvature:
    path = PathCurvature()
    for sample in samples(sources, until_s):
        path.receive_observation(sample)
    return path


def samples(sources: tuple[Callable[[float], Sample], ...], until_s: float) -> Iterator[Sample]:
    for at_s in np.arange(0.0, until_s + 1e-6, 0.1).tolist():
        yield Speed(at_s, SPEED_M_S, 0.28, "obd:7E8")
        for source in sources:
            yield source(at_s)


@pytest.mark.parametrize("name", SOURCES)
@pytest.mark.parametrize("radius_m", [150.0, -300.0, 600.0, -1000.0])
def test_each_source_alone_tells_the_radius(name: str, radius_m: float) -> None:
    curvature = driven(lambda at_s: SOURCES[name](at_s, 1 / radius_m)).at(5.0)

    assert curvature is not None
    assert 1 / curvature.curvature_1_m == pytest.approx(radius_m, rel=0.2)
    assert abs(curvature.curvature_1_m - 1 / radius_m) < 1.5 * curvature.sigma_1_m


def test_several_sources_are_surer_than_one() -> None:
    alone = driven(lambda at_s: yaw_rate(at_s, 1 / 600)).at(5.0)
    both = driven(lambda at_s: yaw_rate(at_s, 1 / 600), lambda at_s: fix(at_s, 1 / 600)).at(5.0)

    assert alone is not None
    assert both is not None
    assert both.sigma_1_m < alone.sigma_1_m


def test_sources_that_contradict_each_other_say_so_by_their_sigma() -> None:
    curvature = driven(
        lambda at_s: yaw_rate(at_s, -1 / 300), lambda at_s: steering(at_s, 1 / 300)
    ).at(5.0)

    assert curvature is not None
    assert curvature.sigma_1_m > 0.3 / 300


def test_where_the_road_begins_to_bend_the_lag_of_courses_is_in_their_sigma() -> None:
    def course(at_s: float) -> Sample:
        course_rad = 0.1 + max(at_s - 4.5, 0.0) * SPEED_M_S / 300
        return Position(at_s, 48.0, 11.0, None, 1.0, SPEED_M_S, course_rad)

    curvature = driven(course).at(5.0)

    assert curvature is not None
    assert curvature.curvature_1_m < 0.7 / 300
    assert curvature.sigma_1_m > 0.3 / 300


@pytest.mark.parametrize("name", SOURCES)
def test_a_silent_source_is_not_used(name: str) -> None:
    path = driven(lambda at_s: SOURCES[name](at_s, 1 / 300))
    for at_s in np.arange(5.1, 7.0, 0.1).tolist():
        path.receive_observation(Speed(at_s, SPEED_M_S, 0.28, "obd:7E8"))

    assert path.at(6.9) is None


def test_nothing_is_known_without_a_speed_or_at_walking_pace() -> None:
    path = PathCurvature()
    path.receive_observation(YawRate(0.0, 0.1, "dbc"))
    assert path.at(0.0) is None

    path.receive_observation(Speed(0.0, 1.5, 0.28, "obd:7E8"))
    assert path.at(0.0) is None


def test_late_samples_change_nothing() -> None:
    path = driven(lambda at_s: yaw_rate(at_s, 1 / 300))
    before = path.at(5.0)

    path.receive_observation(YawRate(4.0, -1.0, "dbc"))

    assert path.at(5.0) == before
