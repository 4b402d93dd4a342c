"""Our own traffic: it is there, keeps its distance, changes lanes, and stops at red."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from onboard.errors import UserError
from sim_rig.roads.car_following import CarFollowing, idm_acceleration
from sim_rig.roads.crashes import boxes_overlap
from sim_rig.roads.crossing import HighwaySettings, IntersectionSettings, crossing, highway
from sim_rig.roads.line_of_sight import Corners
from sim_rig.roads.recording import record
from sim_rig.roads.sources import open_traffic

MODEL = CarFollowing()


def test_the_model_keeps_its_own_equilibrium() -> None:
    """At the gap (s0 + v T) / sqrt(1 - (v / v0)^4) nobody accelerates."""
    speed, top = np.array(10.0), np.array(15.0)
    gap = (MODEL.standing_gap_m + 10.0 * MODEL.headway_s) / np.sqrt(1.0 - (10.0 / 15.0) ** 4)

    assert idm_acceleration(speed, top, gap, np.array(0.0), 3.0, MODEL) == pytest.approx(0.0)
    assert idm_acceleration(speed, top, np.array(np.inf), speed, 3.0, MODEL) > 0.0
    assert idm_acceleration(speed, top, np.array(0.2), speed, 3.0, MODEL) == -8.0


@pytest.mark.long
@pytest.mark.parametrize("source", ["crossing", "highway"])
def test_no_cars_overlap_in_a_minute_of_traffic(source: str) -> None:
    traffic = open_traffic(source, np.random.default_rng(2))
    counts = []
    for step in range(1200):
        cars = traffic.cars_at(step / 10)
        if step % 10 == 0:
            assert boxes_overlap(cars) == []
            counts.append(len(cars))

    assert counts[-1] > 25


@pytest.mark.long
def test_a_dense_crossing_has_a_hundred_cars_and_one_road_stands() -> None:
    traffic = crossing(IntersectionSettings(), np.random.default_rng(1))
    cars = traffic.cars_at(195.0)  # East and west have had green for 15 s.

    along = np.abs(np.sin(cars.heading_rad)) > 0.5
    north_south, east_west = cars.speed_m_s[along], cars.speed_m_s[~along]

    assert 75 < len(cars) < 125
    assert np.median(east_west) > 9.0
    assert (north_south < 0.5).mean() > 0.3


@pytest.mark.long
def test_fast_cars_on_a_highway_change_over_to_pass() -> None:
    traffic = highway(HighwaySettings(arrivals_per_s=0.3), np.random.default_rng(4))
    drives = record(traffic, 60.0, begin_s=30.0).drives

    sideways = [drive for drive in drives if np.ptp(drive.middle_m[:, 1]) > 3.9]

    assert sideways
    assert all(np.ptp(np.diff(drive.middle_m[:, 1])) < 0.5 for drive in drives)


def test_the_same_seed_gives_the_same_traffic() -> None:
    places = [
        open_traffic("crossing", np.random.default_rng(9)).cars_at(40.05).middle_m.tolist()
        for _ in range(2)
    ]

    assert places[0] == places[1]


def test_an_unknown_source_is_an_error_of_the_user() -> None:
    with pytest.raises(UserError, match="no source of traffic 'motorway': it is one of crossing"):
        open_traffic("motorway", np.random.default_rng(0))


@given(
    st.tuples(*[st.floats(-50.0, 50.0)] * 2),
    st.tuples(*[st.floats(-50.0, 50.0)] * 2),
)
@example(here=(0.0, 0.0), there=(0.0, 1e-308))
def test_a_corner_hides_what_lies_behind_it(
    here: tuple[float, float], there: tuple[float, float]
) -> None:
    """Against samples of the line of sight."""
    line = np.linspace(here, there, 400)
    inside = (np.abs(line) > 12.0).all(axis=1)
    grazing = (np.abs(np.abs(line) - 12.0) < 0.6).any(axis=1)

    blocked = Corners(12.0)(np.array(here), np.array(there))

    if (inside & ~grazing).any():
        assert blocked
    elif not inside.any() and not grazing.any():
        assert not blocked
