"""Buildings and cars between two antennas."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from matplotlib.path import Path as Outline

from sim_rig.propagation.shadowing import Building, VehicleShadowing
from sim_rig.radio.links import Links
from sim_rig.scenario.radio_settings import CsmaSettings

SQUARE = ((0.0, 0.0), (20.0, 0.0), (20.0, 10.0), (0.0, 10.0))


def lost_db(building: Building, start: tuple[float, float], end: tuple[float, float]) -> float:
    return float(building.loss_db(np.array([start]), np.array([end]))[0])


@pytest.mark.parametrize("corners", [SQUARE, SQUARE[::-1]])
@pytest.mark.parametrize(
    ("start", "end", "walls", "inside_m"),
    [
        ((-5.0, 5.0), (25.0, 5.0), 2, 20.0),
        ((25.0, 5.0), (-5.0, 5.0), 2, 20.0),
        ((10.0, 5.0), (10.0, 30.0), 1, 5.0),  # from inside
        ((10.0, 30.0), (10.0, 5.0), 1, 5.0),  # to inside
        ((5.0, 5.0), (15.0, 5.0), 0, 10.0),
        ((-5.0, 15.0), (25.0, 15.0), 0, 0.0),
    ],
)
def test_walls_and_metres_inside_both_count(
    corners: tuple[tuple[float, float], ...],
    start: tuple[float, float],
    end: tuple[float, float],
    walls: int,
    inside_m: float,
) -> None:
    building = Building(corners_m=corners, wall_db=9.0, inside_db_per_m=0.4)

    assert lost_db(building, start, end) == pytest.approx(9.0 * walls + 0.4 * inside_m)


coordinate = st.floats(-30.0, 30.0).map(lambda value: round(value, 3) + 1e-4)


@example((-13.9999, -13.9999), (0.0001, 0.0001))  # through a corner
@given(st.tuples(coordinate, coordinate), st.tuples(coordinate, coordinate))
def test_the_length_inside_an_angular_building_is_what_sampling_finds(
    start: tuple[float, float], end: tuple[float, float]
) -> None:
    angular = ((-20.0, -20.0), (20.0, -20.0), (20.0, 0.0), (0.0, 0.0), (0.0, 20.0), (-20.0, 20.0))
    building = Building(corners_m=angular, wall_db=0.0, inside_db_per_m=1.0)
    share = (np.arange(2_000) + 0.5)[:, None] / 2_000
    samples = np.array(start) + share * (np.array(end) - np.array(start))
    length_m = float(np.hypot(end[0] - start[0], end[1] - start[1]))
    sampled_m = length_m * float(np.mean(Outline(angular).contains_points(samples)))

    assert lost_db(building, start, end) == pytest.approx(
        sampled_m, abs=4 * length_m / 2_000 + 1e-3
    )


def vehicles(*middles_m: tuple[float, float], roof_m: float = 1.5) -> VehicleShadowing:
    each = np.ones(len(middles_m))
    return VehicleShadowing(np.array(middles_m), 1.8 * each, roof_m * each)


ENDS = np.array([[0.0, 0.0]]), np.array([[100.0, 0.0]])


def test_a_roof_as_high_as_the_antennas_takes_6_db() -> None:
    # ITU-R P.526: a knife edge that just touches the line of sight halves the field.
    assert vehicles((50.0, 0.3)).loss_db(*ENDS, 1.5, 0.05) == pytest.approx(6.0, abs=0.1)


def test_a_lorry_takes_more_and_a_low_car_nothing() -> None:
    assert vehicles((50.0, 0.0), roof_m=3.5).loss_db(*ENDS, 1.5, 0.05)[0] > 15.0
    assert vehicles((50.0, 0.0), roof_m=0.4).loss_db(*ENDS, 1.5, 0.05)[0] == 0.0


def test_cars_beside_the_line_and_at_its_ends_cause_no_loss() -> None:
    beside = vehicles((50.0, 3.0), (0.0, 0.0), (100.0, 0.0), (-20.0, 0.0), (120.0, 0.0))

    assert beside.loss_db(*ENDS, 1.5, 0.05)[0] == 0.0


def test_the_worst_of_several_counts() -> None:
    several = vehicles((30.0, 0.0), (50.0, 0.0), (70.0, 0.0), roof_m=2.0)
    each = [vehicles((x, 0.0), roof_m=2.0).loss_db(*ENDS, 1.5, 0.05)[0] for x in (30, 50, 70)]

    assert several.loss_db(*ENDS, 1.5, 0.05)[0] == pytest.approx(max(each))


def test_links_are_weakened_both_ways_and_others_left_alone() -> None:
    position_m = np.array([[0.0, 0.0], [100.0, 0.0], [0.0, 100.0]])
    wall = Building(corners_m=((40.0, -5.0), (60.0, -5.0), (60.0, 5.0), (40.0, 5.0)))

    free = Links(CsmaSettings(), position_m).mean_mw
    shadowed = Links(CsmaSettings(buildings=(wall,)), position_m).mean_mw

    assert 10 * np.log10(free[0, 1] / shadowed[0, 1]) == pytest.approx(2 * 9.0 + 20 * 0.4)
    assert shadowed[0, 1] == shadowed[1, 0]
    assert shadowed[0, 2] == free[0, 2]


def test_vehicles_shadow_only_if_enabled() -> None:
    position_m = np.array([[0.0, 0.0], [100.0, 0.0]])
    between = vehicles((50.0, 0.0))

    clear = Links(CsmaSettings(), position_m, between).mean_mw[0, 1]
    shadowed = Links(CsmaSettings(vehicles_shadow=True), position_m, between).mean_mw[0, 1]

    assert 10 * np.log10(clear / shadowed) == pytest.approx(6.0, abs=0.1)
