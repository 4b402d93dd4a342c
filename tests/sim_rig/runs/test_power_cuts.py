"""Power cuts of a car's computer, in virtual time and of processes."""

import asyncio
import time
from pathlib import Path
from typing import Any

import pytest

from onboard.settings import SettingsError
from sim_rig.processes.processes import ProcessError, Processes
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.power_cuts import cut_power, with_power_cuts
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.catalogue import SCENARIOS
from sim_rig.scenario.faults import PowerCut
from sim_rig.scenario.schema import Scenario, load_scenario

CUT_S, RESTORED_S = 8.0, 10.0
FOREVER = ("-c", "import time; time.sleep(60)")


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("power-cut")


@pytest.mark.long
def test_a_car_without_power_is_silent_and_starts_without_memory(
    scenario: Scenario, tmp_path: Path
) -> None:
    log = run_virtual(scenario, recordings_folder=tmp_path)

    own = [each for each in log.traces["red"] if each.get("event") != "power_cut"]
    assert not [each for each in own if CUT_S <= each["stamp_s"] < RESTORED_S]
    leads = [each for each in own if each["kind"] == "lead" and each["stamp_s"] > RESTORED_S]
    assert leads[0]["text"] is None
    assert len(list((tmp_path / "red").iterdir())) == 2
    assert len(list((tmp_path / "green").iterdir())) == 1


def test_a_power_cut_ends_group_and_hard_braking(scenario: Scenario) -> None:
    def record(at_s: float, kind: str, **fields: object) -> dict[str, Any]:
        return {"stamp_s": 100.0 + at_s, "kind": kind, **fields}

    member = {"state": "member", "group_number": 2, "leader_id": "ab"}
    braking = {"deceleration_m_s2": 5.0, "is_over": False}
    trace = [
        record(1.0, "transition", **member),
        record(7.0, "hard_brake", **braking),
        record(12.0, "transition", **member),
        record(13.0, "hard_brake", **braking),
    ]
    log = RunLog(100.0, {"red": with_power_cuts(trace, scenario, "red", 100.0)}, [], {})

    states = [(log.at_s(each), each["state"]) for each in log.of("red", "transition")]
    expected = [(1.0, "member"), (CUT_S, "regular"), (RESTORED_S, "regular"), (12.0, "member")]
    assert states == expected
    assert [log.at_s(each) for each in log.brakings("red")] == [7.0, 13.0]
    assert with_power_cuts(trace, scenario, "green", 100.0) == trace


@pytest.mark.parametrize(
    ("added", "mistake"),
    [
        ("car: red, from_s: 9.0, until_s: 12.0", "the second power_cut of red must begin after"),
        ("car: mute, from_s: 9.0, until_s: 12.0", "faults.1.car: has no computer whose power"),
    ],
)
def test_a_power_cut_that_cannot_be_made_is_a_mistake(
    tmp_path: Path, added: str, mistake: str
) -> None:
    text = (SCENARIOS / "power-cut.yaml").read_text()
    text = text.replace("\nexpect:", f"  - {{what: power_cut, {added}}}\n\nexpect:")
    mute = "cars:\n  mute: {plate: XX1, equipped: false, start_m: 0, speed_m_s: 1}\n"
    (tmp_path / "scenario.yaml").write_text(text.replace("cars:\n", mute))
    with pytest.raises(SettingsError) as found:
        load_scenario(str(tmp_path / "scenario.yaml"))
    assert mistake in str(found.value)


class Switch:
    """Notes what is switched."""

    def __init__(self, *, fails: bool = False) -> None:
        self.done: list[str] = []
        self._fails = fails

    async def cut(self) -> None:
        self.done.append("cut")
        if self._fails:
            raise ProcessError("no relay")

    async def restore(self) -> None:
        self.done.append("restore")


def fault(from_s: float, until_s: float) -> PowerCut:
    return PowerCut(what="power_cut", car="red", from_s=from_s, until_s=until_s)


def test_power_comes_back_at_the_end_of_the_run_and_after_an_error() -> None:
    async def cut_and_end(switch: Switch) -> None:
        now = time.monotonic()
        await cut_power(fault(0.0, 3600.0), switch, now, now)

    late, broken = Switch(), Switch(fails=True)
    asyncio.run(cut_and_end(late))
    assert late.done == ["cut", "restore"]
    with pytest.raises(ProcessError, match="no relay"):
        asyncio.run(cut_and_end(broken))
    assert broken.done == ["cut", "restore"]


def test_power_comes_back_when_the_run_is_aborted_but_only_after_a_cut() -> None:
    async def abort(from_s: float) -> list[str]:
        switch = Switch()
        now = time.monotonic()
        task = asyncio.create_task(cut_power(fault(from_s, 3600.0), switch, now, now + 3600.0))
        while from_s == 0.0 and not switch.done:
            await asyncio.sleep(0.0)
        await asyncio.sleep(0.0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return switch.done

    assert asyncio.run(abort(0.0)) == ["cut", "restore"]
    assert asyncio.run(abort(1800.0)) == []


def test_a_killed_process_may_be_started_again_and_is_watched_again(tmp_path: Path) -> None:
    async def run() -> None:
        async with Processes(tmp_path) as processes:
            await processes.start("other", *FOREVER)
            first = await processes.start("red", *FOREVER)
            waiting = asyncio.create_task(processes.sleep_until(1e12))
            await asyncio.sleep(0.0)
            await processes.kill("red")
            assert first.returncode == -9
            await processes.start("red", "-c", "raise SystemExit('no disk')")
            await waiting

    with pytest.raises(ProcessError, match="red ended unexpectedly: no disk"):
        asyncio.run(run())
