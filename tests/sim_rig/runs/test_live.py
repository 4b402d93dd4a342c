"""Scenarios with real daemons on this machine, one process a car.

The gate runs the demonstration and one fault; `make test-live` runs all of them.
"""

import asyncio
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from sim_rig.processes.gpsd import gpsd_program
from sim_rig.processes.processes import ProcessError, Processes
from sim_rig.reporting.verdict import Outcome, verdict
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.live import LiveTestbench
from sim_rig.scenario.catalogue import scenario_names
from sim_rig.scenario.schema import Scenario, load_scenario

IN_THE_GATE = ("fig4", "stopped-ecu")


def live_scenario(name: str) -> Scenario:
    scenario = load_scenario(name)
    if scenario.gnss is not None and gpsd_program() is None:
        pytest.skip("gpsd is not installed")
    return scenario


def run_live(scenario: Scenario, folder: Path) -> RunLog:
    async def run() -> RunLog:
        async with LiveTestbench(scenario, scenario.seed, folder) as testbench:
            await testbench.run()
        return testbench.log()

    return asyncio.run(run())


@pytest.mark.live
@pytest.mark.parametrize("name", IN_THE_GATE)
def test_real_daemons_meet_all_expectations(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(name)

    found = verdict(scenario, run_live(scenario, tmp_path))
    assert found.outcome is Outcome.PASSED, found


@pytest.mark.live
@pytest.mark.parametrize("name", [name for name in scenario_names() if name not in IN_THE_GATE])
def test_real_daemons_meet_the_expectations_of_all_other_scenarios(
    name: str, tmp_path: Path
) -> None:
    scenario = live_scenario(name)

    found = verdict(scenario, run_live(scenario, tmp_path))
    assert found.outcome is Outcome.PASSED, found


@pytest.mark.long
def test_the_configuration_of_a_daemon_has_nothing_of_other_cars(tmp_path: Path) -> None:
    """Not their plates, not where they are, nor what is expected."""
    scenario = load_scenario("fig4")

    async def set_up() -> None:
        async with LiveTestbench(scenario, scenario.seed, tmp_path):
            pass

    asyncio.run(set_up())

    config = (tmp_path / "red.yaml").read_text()
    assert scenario.cars["red"].identity in config
    for other in ("green", "blue", "yellow"):
        assert scenario.cars[other].identity not in config
    assert "start_m" not in config


def test_an_unexpected_end_is_reported_with_the_last_log_line(tmp_path: Path) -> None:
    async def run() -> None:
        async with Processes(tmp_path) as processes:
            await processes.start("steady", "-c", "import time; time.sleep(60)")
            await processes.start("brief", "-c", "raise SystemExit('out of petrol')")
            await processes.sleep_until(1e12)

    with pytest.raises(ProcessError, match="brief ended unexpectedly: out of petrol"):
        asyncio.run(run())


def test_no_process_outlives_its_testbench(tmp_path: Path) -> None:
    deaf = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); time.sleep(60)"

    async def run() -> list[int | None]:
        async with Processes(tmp_path, stopped_within_s=0.5) as processes:
            started = [
                await processes.start("steady", "-c", "import time; time.sleep(60)"),
                await processes.start("deaf", "-c", deaf),
            ]
        return [process.returncode for process in started]

    codes = asyncio.run(run())
    assert codes[0] == -15
    assert codes[1] in {-9, -15}  # It may be ended before it has closed its ears.


@pytest.mark.long
def test_a_rig_that_gets_sigterm_stops_its_daemons(tmp_path: Path) -> None:
    rig = subprocess.Popen(
        [sys.executable, "-m", "sim_rig", "run", "fig4", "--out", str(tmp_path)],
        stdout=subprocess.DEVNULL,
    )
    give_up_at = time.monotonic() + 60.0
    while not (daemons := psutil.Process(rig.pid).children()) and time.monotonic() < give_up_at:
        time.sleep(0.1)
    rig.terminate()

    assert rig.wait(timeout=30.0) == 128 + 15
    assert daemons
    assert psutil.wait_procs(daemons, timeout=5.0)[1] == []
