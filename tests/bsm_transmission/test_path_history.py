"""The path history has few points, and the path driven is near the lines between them."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from onboard.bsm_transmission.path_history import (
    LENGTH_M,
    MAX_ERROR_M,
    MAX_POINTS,
    PathHistoryKeeper,
)
from onboard.messages import bsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import PathHistory, VehicleSafetyExtensions
from onboard.observations import Position

METRE_DEG = math.degrees(1 / 6_371_000.0)
SPEED_M_S = 15.0


def drive(way_m: NDArray[np.float64]) -> tuple[PathHistory | None, NDArray[np.float64]]:
    """At 10 Hz through `way_m` (n, 2), east and north; the history and its points in metres."""
    keeper = PathHistoryKeeper()
    for i, (east_m, north_m) in enumerate(way_m):
        position = Position(
            stamp_s=i / 10,
            latitude_deg=north_m * METRE_DEG,
            longitude_deg=east_m * METRE_DEG,
            altitude_m=None,
            sigma_m=1.0,
            speed_m_s=SPEED_M_S,
            course_rad=None,
        )
        keeper.receive_position(position)
    history = keeper.history((len(way_m) - 1) / 10)
    crumbs = () if history is None else history.crumb_data
    offsets = [(c.longitude_offset_deg, c.latitude_offset_deg) for c in crumbs]
    points = np.array([(0.0, 0.0), *offsets], float) / METRE_DEG + way_m[-1]
    return history, points


def straight(length_m: float) -> NDArray[np.float64]:
    return np.column_stack([np.zeros(int(length_m / 1.5)), np.arange(int(length_m / 1.5)) * 1.5])


def off_the_line_m(way_m: NDArray[np.float64], points_m: NDArray[np.float64]) -> float:
    """How far the way strays at most from the line through the points, where it reaches."""
    first = int(np.argmin(np.linalg.norm(way_m - points_m[-1], axis=1)))
    nearest_m = np.full(len(way_m) - first, np.inf)
    for one, other in pairwise(points_m):
        along, places = other - one, way_m[first:] - one
        share = np.clip(places @ along / (along @ along), 0.0, 1.0)
        off_m = np.linalg.norm(places - share[:, None] * along, axis=1)
        nearest_m = np.minimum(nearest_m, off_m)
    return float(nearest_m.max())


def test_a_car_that_has_not_moved_has_no_history() -> None:
    assert drive(np.zeros((50, 2)))[0] is None


def test_a_straight_road_needs_two_points_for_200_m() -> None:
    _, points = drive(straight(600.0))

    assert len(points) - 1 <= 2
    assert np.linalg.norm(points[-1] - points[0]) >= LENGTH_M


def test_the_path_history_has_a_point_near_a_corner() -> None:
    corner = np.concatenate([straight(100.0), straight(60.0)[:, ::-1] + (0.0, 100.0)])
    history, points = drive(corner)

    assert history is not None
    assert np.linalg.norm(points - (0.0, 100.0), axis=1).min() < 3.0
    assert off_the_line_m(corner, points) <= MAX_ERROR_M + 0.2


def test_each_path_history_point_has_its_own_age() -> None:
    history, points = drive(straight(150.0))

    assert history is not None
    for crumb, point in zip(history.crumb_data, points[1:], strict=True):
        assert crumb.age_s is not None
        assert crumb.age_s * SPEED_M_S == np.linalg.norm(point - points[0]).round(6)


@settings(max_examples=60)
@given(st.lists(st.floats(-0.15, 0.15), min_size=2, max_size=12))
def test_the_path_stays_near_the_lines_for_any_turns(turns_rad: list[float]) -> None:
    """Each turn is of one step of 1.5 m and kept for twenty: radii from 10 m."""
    headings = np.cumsum(np.repeat(turns_rad, 20))
    way = np.cumsum(1.5 * np.column_stack([np.sin(headings), np.cos(headings)]), axis=0)
    history, points = drive(way)

    assert history is not None
    assert len(history.crumb_data) <= MAX_POINTS
    # The last point may leave the line by what the cone has not yet seen to be too much.
    assert off_the_line_m(way, points) <= 2 * MAX_ERROR_M


def received(history: PathHistory | None) -> PathHistory | None:
    """Return the path history after encoding and decoding a BSM."""
    sent = BasicSafetyMessage(CoreData(0, b"abcd"), VehicleSafetyExtensions(None, history))
    safety = bsm.decode(bsm.encode(sent)).safety
    return None if safety is None else safety.path_history


def test_the_path_history_survives_a_bsm() -> None:
    history, _ = drive(straight(100.0))

    got = received(history)

    assert history is not None
    assert got is not None
    assert len(got.crumb_data) == len(history.crumb_data)


@pytest.mark.parametrize(
    ("latitude_deg", "silent_m"),
    [(48.0, 0.0), (78.2, 0.0), (-89.0, 0.0), (48.0, 3000.0)],
    ids=["anywhere", "far north", "near the pole", "behind a tunnel"],
)
def test_every_point_is_where_the_car_was_at_its_age(latitude_deg: float, silent_m: float) -> None:
    """East by 600 m, without a fix for `silent_m` before the last 60 m."""
    keeper = PathHistoryKeeper()
    metre_deg = METRE_DEG / math.cos(math.radians(latitude_deg))
    ways_m = [x if x < 540.0 else x + silent_m for x in np.arange(0.0, 600.0, 1.5)]
    driven = [
        Position(way_m / SPEED_M_S, latitude_deg, way_m * metre_deg, None, 1.0, SPEED_M_S, None)
        for way_m in ways_m
    ]
    for position in driven:
        keeper.receive_position(position)

    decoded = received(keeper.history(driven[-1].stamp_s))

    for crumb in () if decoded is None else decoded.crumb_data:
        assert crumb.longitude_offset_deg is not None
        assert crumb.age_s is not None
        behind_m = -crumb.longitude_offset_deg / metre_deg
        assert behind_m == pytest.approx(crumb.age_s * SPEED_M_S, abs=1.0)
