"""A road may be given by its bends; cars drive along it, and turn as it does."""

import math

import pytest

from onboard.settings import parse_settings
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.roads.path import Path, bent_m
from sim_rig.roads.road import yaw_rate_rad_s
from sim_rig.scenario.schema import Scenario

RADIUS_M, SPEED_M_S = 150.0, 15.0


def road(radius_m: float, bends: object = None) -> BreakpointRoad:
    bend = {"from_m": 100.0, "until_m": 400.0, "radius_m": radius_m}
    tree = {
        "title": "A car drives through a bend.",
        "seed": 1,
        "duration_s": 40.0,
        "radio": {"reach_m": 300.0},
        "roads": {"road": {"bends": bends or [bend]}},
        "cars": {"ann": {"plate": "RA111AA", "start_m": 0.0, "speed_m_s": SPEED_M_S}},
        "expect": [],
    }
    return BreakpointRoad(parse_settings(tree, Scenario, "bend"))


def test_a_quarter_of_a_circle_to_the_right_ends_southwards() -> None:
    path = Path(bent_m([(100.0, 100.0 + RADIUS_M * math.pi / 2, RADIUS_M)]))

    assert path.place(50.0, 0.0) == pytest.approx((50.0, 0.0))
    end = path.place(100.0 + RADIUS_M * math.pi / 2, 0.0)
    assert end == pytest.approx((100.0 + RADIUS_M, -RADIUS_M), abs=0.1)
    after = path.place(110.0 + RADIUS_M * math.pi / 2, 0.0)
    assert after == pytest.approx((end[0], end[1] - 10.0), abs=0.1)


@pytest.mark.parametrize("radius_m", [RADIUS_M, -RADIUS_M, 600.0])
def test_the_yaw_rate_in_a_bend_is_speed_over_radius_and_positive_to_the_left(
    radius_m: float,
) -> None:
    it = road(radius_m)

    assert yaw_rate_rad_s(it, "ann", 3.0) == pytest.approx(0.0, abs=1e-9)
    assert yaw_rate_rad_s(it, "ann", 15.0) == pytest.approx(-SPEED_M_S / radius_m, rel=0.05)


def test_the_lane_ahead_in_a_bend_leaves_the_axis_of_the_car() -> None:
    it = road(RADIUS_M)
    (point,) = it.lane_ahead("ann", 15.0, [20.0])

    ahead_m, right_m = it.car_at("ann", 15.0).seen_from_front(*point)

    assert ahead_m == pytest.approx(20.0, abs=0.5)
    assert right_m == pytest.approx(22.25**2 / 2 / RADIUS_M, abs=0.1)


@pytest.mark.parametrize(
    ("bends", "message"),
    [
        ([{"from_m": 0.0, "until_m": 50.0, "radius_m": 5.0}], "10 or more on either side"),
        ([{"from_m": 50.0, "until_m": 50.0, "radius_m": 50.0}], "until_m must be after from_m"),
        (
            [
                {"from_m": 0.0, "until_m": 50.0, "radius_m": 50.0},
                {"from_m": 40.0, "until_m": 90.0, "radius_m": 50.0},
            ],
            "bends must follow each other",
        ),
    ],
)
def test_a_bend_that_cannot_be_is_an_error(bends: object, message: str) -> None:
    with pytest.raises(Exception, match=message):
        road(50.0, bends)
