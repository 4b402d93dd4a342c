"""Positions of vehicles on the map."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.hmi.vehicle_map import MOST_VEHICLES, RANGE_M, VehicleMap
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject


def perceived(
    east_m: float, north_m: float, east_m_s: float = 0.0, north_m_s: float = 0.0
) -> PerceivedObject:
    state = (east_m, north_m, east_m_s, north_m_s)
    return PerceivedObject(0.0, "7", ObjectSource.BSM, state, ((0.0,) * 4,) * 4, 0.1, frozenset())


def map_with(host: PerceivedObject) -> VehicleMap:
    map_ = VehicleMap(4.5)
    map_.receive_host_vehicle(host)
    return map_


@given(
    heading=st.floats(-math.pi, math.pi),
    ahead_m=st.floats(-100.0, 100.0),
    right_m=st.floats(-100.0, 100.0),
    origin=st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)),
)
def test_ahead_and_right_are_relative_to_the_heading_of_the_host_vehicle(
    heading: float, ahead_m: float, right_m: float, origin: tuple[float, float]
) -> None:
    sin, cos = math.sin(heading), math.cos(heading)
    host = perceived(*origin, 20.0 * sin, 20.0 * cos)
    other = perceived(
        origin[0] + ahead_m * sin + right_m * cos,
        origin[1] + ahead_m * cos - right_m * sin,
        20.0 * sin,
        20.0 * cos,
    )

    placed = next(iter(map_with(host).vehicles([other], ())), None)

    if math.hypot(ahead_m, right_m) > RANGE_M:
        assert placed is None
    elif placed is not None:
        assert (placed.ahead_m, placed.right_m) == pytest.approx((ahead_m, right_m), abs=1e-6)
        assert placed.relative_heading_rad == pytest.approx(0.0, abs=1e-9)


def test_a_stopped_host_vehicle_keeps_its_last_heading() -> None:
    map_ = map_with(perceived(0.0, 0.0, 10.0, 0.0))
    map_.receive_host_vehicle(perceived(0.0, 0.0))

    (placed,) = map_.vehicles([perceived(20.0, 0.0)], ())

    assert (placed.ahead_m, placed.right_m) == pytest.approx((20.0, 0.0))
    assert placed.relative_heading_rad is None


def test_without_a_heading_the_map_is_empty() -> None:
    assert map_with(perceived(0.0, 0.0)).vehicles([perceived(20.0, 0.0)], ()) == []


@pytest.mark.parametrize("east_m", [math.nan, math.inf, 1e9])
def test_an_object_without_a_finite_position_in_range_is_not_shown(east_m: float) -> None:
    assert map_with(perceived(0.0, 0.0, 0.0, 9.0)).vehicles([perceived(east_m, 0.0)], ()) == []


def test_of_many_objects_the_nearest_are_shown() -> None:
    objects = [perceived(float(n % 7), float(n)) for n in range(100)]

    placed = map_with(perceived(0.0, 0.0, 0.0, 9.0)).vehicles(objects, ())

    assert len(placed) == MOST_VEHICLES
    assert max(each.ahead_m for each in placed) < MOST_VEHICLES
