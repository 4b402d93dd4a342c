"""Where cars stand on the map."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.hmi.vehicle_map import MOST_CARS, RANGE_M, VehicleMap
from onboard.mvs.perceived_object import ObjectSource, PerceivedObject


def car(
    east_m: float, north_m: float, east_m_s: float = 0.0, north_m_s: float = 0.0
) -> PerceivedObject:
    state = (east_m, north_m, east_m_s, north_m_s)
    return PerceivedObject(0.0, "7", ObjectSource.BSM, state, ((0.0,) * 4,) * 4, 0.1, frozenset())


@given(
    heading=st.floats(-math.pi, math.pi),
    ahead_m=st.floats(-100.0, 100.0),
    right_m=st.floats(-100.0, 100.0),
    own=st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)),
)
def test_ahead_and_right_are_those_of_the_own_heading(
    heading: float, ahead_m: float, right_m: float, own: tuple[float, float]
) -> None:
    sin, cos = math.sin(heading), math.cos(heading)
    moving = car(*own, 20.0 * sin, 20.0 * cos)
    other = car(
        own[0] + ahead_m * sin + right_m * cos,
        own[1] + ahead_m * cos - right_m * sin,
        20.0 * sin,
        20.0 * cos,
    )

    (placed,) = VehicleMap(4.5).place(moving, [other], ())[:1] or [None]

    if math.hypot(ahead_m, right_m) > RANGE_M:
        assert placed is None
    elif placed is not None:
        assert (placed.ahead_m, placed.right_m) == pytest.approx((ahead_m, right_m), abs=1e-6)
        assert placed.turned_rad == pytest.approx(0.0, abs=1e-9)


def test_a_car_that_stands_keeps_the_heading_it_came_with() -> None:
    around = VehicleMap(4.5)
    around.place(car(0.0, 0.0, 10.0, 0.0), (), ())

    (placed,) = around.place(car(0.0, 0.0), [car(20.0, 0.0)], ())

    assert (placed.ahead_m, placed.right_m) == pytest.approx((20.0, 0.0))
    assert placed.turned_rad is None


def test_a_car_that_has_never_moved_does_not_know_where_ahead_is() -> None:
    assert VehicleMap(4.5).place(car(0.0, 0.0), [car(20.0, 0.0)], ()) == []


@pytest.mark.parametrize("east_m", [math.nan, math.inf, 1e9])
def test_a_car_that_is_nowhere_is_not_drawn(east_m: float) -> None:
    assert VehicleMap(4.5).place(car(0.0, 0.0, 0.0, 9.0), [car(east_m, 0.0)], ()) == []


def test_of_a_crowd_the_nearest_are_drawn() -> None:
    crowd = [car(float(n % 7), float(n)) for n in range(100)]

    placed = VehicleMap(4.5).place(car(0.0, 0.0, 0.0, 9.0), crowd, ())

    assert len(placed) == MOST_CARS
    assert max(each.ahead_m for each in placed) < MOST_CARS
