"""Roads in the plane: where a car on a path is, which way it points, where on earth it is."""

import math

import numpy as np
import pytest

from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.roads.earth import ORIGIN, to_degrees
from sim_rig.roads.path import Path
from sim_rig.roads.road import CarState
from sim_rig.scenario.schema import Scenario

CORNER = ((0.0, 0.0), (100.0, 0.0), (100.0, 100.0))
"""East, then north."""


def on_the_corner(start_m: float, lane: float = 1.0) -> CarState:
    scenario = Scenario.model_validate(
        {
            "title": "A car drives round a corner.",
            "seed": 1,
            "duration_s": 10.0,
            "radio": {"reach_m": 100.0},
            "roads": {"corner": {"points_m": CORNER}},
            "cars": {
                "ann": {
                    "plate": "X1",
                    "road": "corner",
                    "start_m": start_m,
                    "speed_m_s": 10.0,
                    "lane": lane,
                }
            },
            "expect": (),
        }
    )
    return BreakpointRoad(scenario).car_at("ann", 0.0)


@pytest.mark.parametrize(
    ("along_m", "left_m", "place"),
    [
        (30.0, 0.0, (30.0, 0.0)),
        (30.0, 3.5, (30.0, 3.5)),
        (150.0, 0.0, (100.0, 50.0)),
        (150.0, 3.5, (96.5, 50.0)),
        (-20.0, 0.0, (-20.0, 0.0)),
        (230.0, 0.0, (100.0, 130.0)),
    ],
)
def test_a_path_is_a_polyline_and_straight_beyond_its_ends(
    along_m: float, left_m: float, place: tuple[float, float]
) -> None:
    assert Path(CORNER).place(along_m, left_m) == pytest.approx(place)


def test_the_heading_of_a_car_is_that_of_its_road() -> None:
    assert math.degrees(on_the_corner(50.0).heading_rad) == pytest.approx(90.0)
    assert math.degrees(on_the_corner(150.0).heading_rad) == pytest.approx(0.0)


def test_in_a_corner_it_turns_as_long_as_it_is() -> None:
    """Front and rear follow the line: half of the car is round, it points half way."""
    half_round = on_the_corner(102.25)

    assert math.degrees(half_round.heading_rad) == pytest.approx(45.0)
    assert (half_round.x_m, half_round.y_m) == pytest.approx((98.875, 1.125))


def test_the_middle_of_a_car_is_half_its_length_behind_its_front() -> None:
    car = on_the_corner(50.0, lane=2.0)

    assert (car.x_m, car.y_m) == pytest.approx((47.75, 3.5))
    assert car.point(2.25, 0.0) == pytest.approx((50.0, 3.5))
    assert car.point(0.0, 0.9) == pytest.approx((47.75, 2.6))
    assert car.seen_from_front(60.0, 0.0) == pytest.approx((10.0, 3.5))


@pytest.mark.parametrize("place_m", [(0.0, 0.0), (300.0, -200.0), (-5000.0, 4000.0)])
def test_degrees_lead_back_to_the_place(place_m: tuple[float, float]) -> None:
    assert ORIGIN.position_m(*to_degrees(*place_m)) == pytest.approx(np.array(place_m), abs=1e-4)
