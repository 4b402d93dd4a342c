"""What a car's camera shows of its road."""

import numpy as np
import pytest

from sim_rig.cars.camera_view import CameraView
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.scenario.schema import load_scenario


def drawn(name: str, car: str, at_s: float) -> tuple[tuple[float, float], ...]:
    scenario = load_scenario(name)
    view = CameraView(scenario, BreakpointRoad(scenario), car, np.random.default_rng(1))
    return view.scene(at_s).middle_m


@pytest.mark.parametrize(
    ("name", "car", "at_s", "radius_m"),
    [("bend", "eva", 11.0, -300.0), ("bend-600", "car1", 14.0, 600.0)],
)
def test_a_bend_is_drawn_however_the_road_is_given(
    name: str, car: str, at_s: float, radius_m: float
) -> None:
    """A camera that sees a straight road there takes a car of the next lane for its lead."""
    ahead_m, right_m = np.array(drawn(name, car, at_s)[:26]).T
    bend, _, _ = np.polyfit(ahead_m, right_m, 2)

    assert 2 * bend == pytest.approx(1 / radius_m, rel=0.1)


@pytest.mark.parametrize(("name", "car"), [("fig4", "red"), ("left-turn", "turns")])
def test_a_straight_road_is_drawn_so_and_one_that_another_turns_off(name: str, car: str) -> None:
    assert drawn(name, car, 1.0) == ()
