"""Every scenario in virtual time: as expected, the same for the same seed, other for another."""

import json
from pathlib import Path

import numpy as np
import pytest

from onboard.errors import UserError
from onboard.obd.settings import BroadcastSettings
from onboard.vehicle.stack import Stack
from sim_rig.reporting.report import failures
from sim_rig.roads.cars import Guests, Traffic
from sim_rig.roads.crossing import IntersectionSettings, crossing
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.background_settings import BackgroundSettings
from sim_rig.scenario.catalogue import scenario_names
from sim_rig.scenario.schema import Scenario, load_scenario
from sim_rig.scenario.sensor_settings import ReceiverSettings

SHORT = {"ar-tags", "bridge", "collision", "late-join"}
"""Scenarios of the gate, one of each kind; the others are long tests."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in SHORT else pytest.mark.long)
        for name in scenario_names()
    ],
)
def test_everything_comes_as_the_scenario_expects(name: str) -> None:
    scenario = load_scenario(name)

    assert failures(scenario, run_virtual(scenario)) == []


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [
        "fig4",
        "lane-change",
        "red-light",
        "shared-detection",
        "shared-sdsm",
    ],
)
def test_signed_and_with_one_late_fix_a_second_it_comes_all_the_same(name: str) -> None:
    """As with a receiver out of the box: 1 Hz, each fix reported 0.4 s late."""
    scenario = load_scenario(name)
    receiver = (scenario.gnss or ReceiverSettings()).model_copy(
        update={"rate_hz": 1.0, "latency_s": 0.4}
    )
    scenario = scenario.model_copy(update={"signed": True, "gnss": receiver})

    assert failures(scenario, run_virtual(scenario)) == []


def traces(log: RunLog) -> dict[str, str]:
    return {name: json.dumps(trace) for name, trace in {**log.traces, "rig": log.rig}.items()}


@pytest.fixture(scope="module")
def lossy() -> Scenario:
    return load_scenario("packet-loss").model_copy(update={"duration_s": 12.0})


@pytest.mark.long
def test_one_seed_gives_the_same_traces_to_the_byte(lossy: Scenario) -> None:
    assert traces(run_virtual(lossy, 5)) == traces(run_virtual(lossy, 5))


@pytest.mark.long
def test_another_seed_gives_other_noise_and_other_losses(lossy: Scenario) -> None:
    one, other = traces(run_virtual(lossy, 5)), traces(run_virtual(lossy, 6))

    assert all(one[car] != other[car] for car in one)


@pytest.mark.long
def test_stamps_of_a_trace_never_exceed_the_run_and_messages_come_in_order(lossy: Scenario) -> None:
    log = run_virtual(lossy)
    for trace in log.traces.values():
        received = [record["stamp_s"] for record in trace if record["kind"] == "received"]
        assert received == sorted(received)
        assert max(record["stamp_s"] for record in trace) <= lossy.duration_s


@pytest.mark.long
def test_a_car_without_daemon_is_detected_and_sends_nothing() -> None:
    scenario = load_scenario("fig4").model_copy(update={"duration_s": 9.0})
    green = scenario.cars["green"].model_copy(update={"equipped": False})
    scenario = scenario.model_copy(update={"cars": {**scenario.cars, "green": green}})

    log = run_virtual(scenario)

    assert "green" not in log.traces
    leads = [record["text"] for record in log.of("red", "lead", from_s=8.0)]
    assert set(leads) == {"GN417KB"}
    assert not list(log.of("red", "transition", from_s=0.0, state="member"))


def test_a_core_that_is_always_due_is_an_error_and_not_an_endless_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Stack, "get_timer", lambda _stack: 1.0)

    with pytest.raises(RuntimeError, match=r"a timer stays due at 1.0 s"):
        run_virtual(load_scenario("fig4"))


def test_a_user_error_leaves_no_source_of_traffic_open(monkeypatch: pytest.MonkeyPatch) -> None:
    """SUMO runs one simulation in a process: the next run would be refused."""
    is_open = False

    def opened(_: str, rng: np.random.Generator, __: Guests) -> Traffic:
        nonlocal is_open
        is_open = True
        traffic = crossing(IntersectionSettings(), rng)
        monkeypatch.setattr(traffic, "close", closed)
        return traffic

    def closed() -> None:
        nonlocal is_open
        is_open = False

    monkeypatch.setattr("sim_rig.cars.background_positions.open_traffic", opened)
    scenario = load_scenario("unsafe-driver")
    broadcast = BroadcastSettings(dbc=Path("missing.dbc"), speed=("WHEELS.LEFT",))
    cars = {
        name: car.model_copy(update={"broadcast": broadcast}) for name, car in scenario.cars.items()
    }
    traffic = {"background_traffic": 1, "traffic": BackgroundSettings(source="sumo-crossing")}

    with pytest.raises(UserError, match=r"missing\.dbc"):
        run_virtual(scenario.model_copy(update={"cars": cars, **traffic}))
    assert not is_open
