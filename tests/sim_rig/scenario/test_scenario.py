"""A mistake in a scenario is reported with file, field and value; the rig's scenarios have none."""

from pathlib import Path

import pytest

from onboard.settings import SettingsError
from sim_rig.scenario.catalogue import scenario_names
from sim_rig.scenario.schema import Scenario, load_scenario

GOOD = """
title: Two cars drive one behind the other and nothing happens.
seed: 1
duration_s: 10
radio: {reach_m: 300}
cars:
  green: {plate: AB123CD, start_m: 30, lane: 1, speed_m_s: [[0, 15], [5, 10]]}
  red: {tag_id: 7, start_m: 0, lane: 1, speed_m_s: 15}
expect:
  - {what: state, car: red, by_s: 5, state: member, leader: green}
"""


def load(tmp_path: Path, text: str) -> Scenario:
    path = tmp_path / "scenario.yaml"
    path.write_text(text)
    return load_scenario(str(path))


def test_a_constant_stands_for_one_breakpoint(tmp_path: Path) -> None:
    scenario = load(tmp_path, GOOD)

    assert scenario.cars["red"].speed_m_s == ((0.0, 15.0),)
    assert scenario.cars["green"].speed_m_s == ((0.0, 15.0), (5.0, 10.0))
    assert [car.identity for car in scenario.cars.values()] == ["AB123CD", "TAG7"]


@pytest.mark.parametrize(
    ("good", "bad", "message"),
    [
        ("seed: 1", "sead: 1", "sead: unknown key (given 1)"),
        ("seed: 1", "", "seed: is required and missing"),
        ("title: Two", "title: two", "title: String should match pattern"),
        ("speed_m_s: 15}", "speed_m_s: fast}", "cars.red.speed_m_s: Input should be a valid array"),
        ("speed_m_s: 15}", "speed_m_s: -1}", "cars.red.speed_m_s.0.1: Input should be greater"),
        ("[5, 10]", "[0, 10]", "cars.green.speed_m_s: breakpoints must grow in time"),
        ("lane: 1,", "lain: 1,", "cars.green.lain: unknown key (given 1)"),
        ("reach_m: 300", "", "radio: exactly one of reach_m and neighbours"),
        ("{reach_m: 300}", "{neighbours: {blue: [red]}}", "radio.neighbours.blue: no such car"),
        ("car: red", "car: rad", "expect.0: no such car (given 'rad'); cars: green, red"),
        ("what: state", "what: stat", "expect.0.what: Input should be one of 'state', "),
        ("state: member", "state: boss", "state: Input should be 'regular', 'leader' or 'member'"),
        ("tag_id: 7", "plate: AB123CD", "cars.red: has the identity of green (given 'AB123CD')"),
        ("tag_id: 7", "tag_id: 7, plate: X1", "cars.red: exactly one of plate and tag_id"),
        (
            "expect:",
            "signal: {approaches: {lane: {stop_line_m: 9, green_s: [0, 20]}}}\nexpect:",
            "signal.approaches.lane: no such road; roads: road",
        ),
        (
            "expect:",
            "signal: {approaches: {road: {stop_line_m: 9, green_s: [0, 58]}}}\nexpect:",
            "signal: green of road must begin before it ends, and leave 3 s of yellow in the cycle",
        ),
        ("tag_id: 7,", "tag_id: 7, equipped: false,", "expect.0: 'red' is not equipped"),
        (
            "expect:",
            "faults: [{what: ecu_stopped, car: red, from_s: 3, until_s: 2}]\nexpect:",
            "faults.0.until_s: must be after from_s (given 2)",
        ),
        (
            "expect:",
            "faults: [{what: ecu_gone, car: red, from_s: 3, until_s: 4}]\nexpect:",
            "faults.0.what: Input should be one of ",
        ),
        ("duration_s: 10", "duration_s: .inf", "duration_s:"),
        ("by_s: 5,", "by_s: 5, until_s: 4,", "expect.0.until_s: must be after by_s (given 4)"),
        (
            "by_s: 5,",
            "by_s: 10,",
            "expect.0.by_s: must be before the end of the scenario, duration_s = 10 (given 10)",
        ),
        ("tag_id: 7,", "tag_id: 7, road: lane,", "cars.red.road: no such road (given 'lane')"),
        (
            "cars:",
            "roads: {road: {points_m: [[0, 0], [0, 0]]}}\ncars:",
            "roads.road: two points of a road that follow each other must differ",
        ),
        (
            "cars:",
            "traffic: {source: sumo-highway}\ncars:",
            "traffic: drives background_traffic (given 0); allowed: 1 to 200",
        ),
    ],
)
def test_a_mistake_names_file_field_and_value(
    tmp_path: Path, good: str, bad: str, message: str
) -> None:
    assert good in GOOD
    with pytest.raises(SettingsError) as error:
        load(tmp_path, GOOD.replace(good, bad, 1))

    assert message in str(error.value)
    assert str(error.value).startswith(f"{tmp_path / 'scenario.yaml'}: ")


@pytest.mark.parametrize(
    ("entry", "remedy"),
    [
        ("what: sent, cars: [red], from_s: 0, until_s: 9", "needs at_least above 0, or at_most"),
        ("what: delivered, sender: red, car: green, from_s: 0, until_s: 9", "needs at_least above"),
        ("what: warning, braking: green, at_s: [5]", "needs within_s, not_warned or discarded"),
        (
            "what: alarm, car: red, cause: fcw, from_s: 0, by_s: 9, least_lead_s: 3",
            "least_lead_s needs of",
        ),
    ],
)
def test_an_expectation_that_never_fails_is_refused(
    tmp_path: Path, entry: str, remedy: str
) -> None:
    expected = f"expect:\n  - {{{entry}}}\n"

    with pytest.raises(SettingsError, match=f"expect.0: {remedy}"):
        load(tmp_path, GOOD.partition("expect:")[0] + expected)


def test_an_unknown_name_lists_all_scenarios() -> None:
    with pytest.raises(SettingsError, match=r"fig5: no such scenario or file; .*fig4"):
        load_scenario("fig5")


@pytest.mark.parametrize("name", scenario_names())
def test_the_scenarios_of_the_rig_have_no_mistake(name: str) -> None:
    assert load_scenario(name).expect


@pytest.mark.parametrize("name", scenario_names())
def test_a_scenario_written_for_the_process_of_the_cameras_is_the_same(
    tmp_path: Path, name: str
) -> None:
    scenario = load_scenario(name)

    assert load(tmp_path, scenario.model_dump_json()) == scenario


def test_a_car_s_configuration_that_is_given_as_a_scenario_names_the_command_for_it() -> None:
    with pytest.raises(SettingsError, match=r"^[^\n]*: onboard run examples/car.yaml$"):
        load_scenario("examples/car.yaml")
