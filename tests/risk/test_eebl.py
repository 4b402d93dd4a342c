"""EEBL on roads with bends: the host's lane, and the lanes beside it."""

import pytest

from onboard.risk.alarm import Alarm, Level
from onboard.risk.eebl import EEBL
from tests.risk.bends import LANE_M, Road, Scene

BENDS = {
    "straight": lambda way_m: 0.0,
    "bend": lambda way_m: 1.0 / 300.0,
    "bend to the right": lambda way_m: -1.0 / 300.0,
    "into a bend": lambda way_m: 1.0 / 300.0 if way_m > 330.0 else 0.0,
    "out of a bend": lambda way_m: 1.0 / 300.0 if way_m < 330.0 else 0.0,
    "from left to right": lambda way_m: 1.0 / 300.0 if way_m < 330.0 else -1.0 / 300.0,
}
"""Curvature; the host vehicle is at 300 m."""
SEEDS = range(5)


def raises_eebl(scene: Scene) -> bool:
    monitor, own, other, now = scene.drive(300.0)
    monitor.assess(own, [other], now)
    return any(
        isinstance(event, Alarm) and event.cause == EEBL and event.level is not Level.NONE
        for event in iter(monitor.next_event, None)
    )


@pytest.mark.parametrize("bend", BENDS)
def test_hard_braking_45_m_ahead_in_the_own_lane(bend: str) -> None:
    road = Road(BENDS[bend])

    assert all(raises_eebl(Scene(road, 45.0, lambda _: 0.0, seed=seed)) for seed in SEEDS)


@pytest.mark.parametrize("left_m", [-LANE_M, LANE_M])
@pytest.mark.parametrize("bend", BENDS)
def test_hard_braking_45_m_ahead_in_the_lane_beside(bend: str, left_m: float) -> None:
    road = Road(BENDS[bend])

    assert not any(raises_eebl(Scene(road, 45.0, lambda _: left_m, seed=seed)) for seed in SEEDS)


def test_a_vehicle_that_has_changed_into_the_own_lane() -> None:
    """Its path history passes beside the host vehicle."""

    def cuts_in(way_m: float) -> float:
        return LANE_M if way_m < 270.0 else max(LANE_M - (way_m - 270.0) / 10.0, 0.0)

    road = Road(BENDS["bend"])
    assert all(raises_eebl(Scene(road, 30.0, cuts_in, seed=seed)) for seed in SEEDS)
