"""Before the start of a live run: where places are measured, cars drive up to it."""

import pytest

from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.scenario.catalogue import scenario_names
from sim_rig.scenario.scenario_clock import RUN_UP_S, ScenarioClock
from sim_rig.scenario.schema import load_scenario


def test_the_clock_waits_and_then_runs_up_to_the_start_and_on() -> None:
    clock = ScenarioClock(run_up_s=3.0)
    assert [clock.at_s(now) for now in (0.0, 50.0)] == [-3.0, -3.0]

    clock.start_s = 100.0
    assert [clock.at_s(now) for now in (96.0, 97.0, 98.5, 100.0, 107.0)] == [-3, -3, -1.5, 0, 7]


def test_without_receivers_nothing_runs_up() -> None:
    """Cameras and ECUs show one instant then, in which no distance changes."""
    assert load_scenario("fig4").run_up_s == 0.0
    assert load_scenario("delayed-footers").run_up_s == RUN_UP_S


@pytest.mark.parametrize("name", scenario_names())
def test_cars_move_as_fast_as_they_say_until_the_start(name: str) -> None:
    scenario = load_scenario(name)
    road = BreakpointRoad(scenario)
    for at_s in (-RUN_UP_S, -RUN_UP_S / 2):
        before, after = road.cars_at(at_s), road.cars_at(at_s + 0.01)
        for car in scenario.cars:
            moved_m = after[car].front_m - before[car].front_m
            assert moved_m == pytest.approx(0.01 * before[car].speed_m_s)


def test_a_fault_of_the_start_is_there_before_it() -> None:
    scenario = load_scenario("mute-transmitter")
    assert scenario.has_fault("radio_mute", "a", -1.0)
    assert not load_scenario("stopped-ecu").has_fault("ecu_stopped", "red", -1.0)
