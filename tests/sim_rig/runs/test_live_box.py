"""A box is a car of the rig: here a daemon that the test starts with its own configuration."""

import asyncio
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest
import yaml

from onboard.recorder.reader import RecordedDrive
from onboard.replay.replay import compare
from onboard.tools.doctor.finding import FindingLevel
from sim_rig.boxes.contact import BoxNotReadyError
from sim_rig.boxes.settings import BoxSettings, PageSettings, PowerSettings, load_boxes
from sim_rig.boxes.trial_keys import run_credentials
from sim_rig.cars.camera_view import calibration
from sim_rig.reporting.verdict import Outcome, verdict
from sim_rig.run_log.latency_ledger import ledger
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.doctor import examine_box
from sim_rig.runs.live import LiveTestbench
from sim_rig.scenario.car_config import DIGEST
from sim_rig.scenario.schema import Scenario, load_scenario
from tests.hmi.test_page_server import TOKEN

pytestmark = pytest.mark.live

AHEAD_S = 1000
"""The box's monotonic clock minus the rig's, where the kernel lets a process have its own."""
OWN_CLOCK = ("unshare", "--time", "--fork", "--kill-child", "--monotonic", str(AHEAD_S))

RESTARTED = 'until "$0" -m onboard run "$1"; do sleep 0.2; done'
"""As systemd does while the rig is off."""


@cache
def has_own_clock() -> bool:
    try:
        return (
            subprocess.run([*OWN_CLOCK, "true"], check=False, capture_output=True).returncode == 0
        )
    except FileNotFoundError:
        return False


@pytest.fixture
def scenario() -> Scenario:
    """Of `fig4`, red and green until after the first braking, which is enough for one warning."""
    whole = load_scenario("fig4")
    state, leads, *_, warning = whole.expect
    return whole.model_copy(
        update={
            "cars": {name: whole.cars[name] for name in ("green", "red")},
            "duration_s": 13.0,
            "expect": (
                state.model_copy(update={"until_s": 13.0}),
                leads.model_copy(update={"until_s": 13.0}),
                warning.model_copy(
                    update={
                        "at_s": (10.0,),
                        "within_s": {"red": 0.8},
                        "not_warned": ("green",),
                        "discarded": {},
                    }
                ),
            ),
        }
    )


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def box(tmp_path: Path, scenario: Scenario) -> BoxSettings:
    stream, datagram = socket.SOCK_STREAM, socket.SOCK_DGRAM
    tree = {
        "plate": "RD288HX",
        "bus": {"port": free_port(stream)},
        "camera": {"port": free_port(stream)},
        "radio": {"port": free_port(datagram), "box_port": free_port(datagram)},
        "keys": str(tmp_path / "trial"),
        "recording": str(tmp_path / "fetched"),
        "fetch": ["cp", "-r", str(tmp_path / "drive"), str(tmp_path / "fetched")],
    }
    file = tmp_path / "red.yaml"
    file.write_text(yaml.safe_dump(tree))
    return load_boxes([f"red={file}"], scenario)["red"]


@contextmanager
def running(box: BoxSettings, scenario: Scenario, folder: Path, utc_s: float) -> Iterator[None]:
    """Run the box."""
    run_credentials(scenario, {"red": box}, utc_s)
    file = configured(box, scenario, folder)
    clock = OWN_CLOCK if has_own_clock() else ()
    with (folder / "car.log").open("wb") as log:
        process = subprocess.Popen(
            [*clock, "sh", "-c", RESTARTED, sys.executable, str(file)],
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
        try:
            yield
        finally:
            os.killpg(process.pid, signal.SIGKILL)  # unshare ignores SIGTERM
            process.wait(10.0)


def configured(box: BoxSettings, scenario: Scenario, folder: Path) -> Path:
    """Write its configuration: nothing of it comes from the rig but the camera's lens."""
    config = {
        "car": {"plate": box.plate},
        "can": {"port": box.bus.port},
        "camera": {"source": f"http://127.0.0.1:{box.camera.port}/red"}
        | calibration(scenario.lens).model_dump(),
        "radio": {
            "endpoint": "iwcu",
            "listen_port": box.radio.box_port,
            "unit_port": box.radio.port,
        },
        "security": {"keys_folder": str(box.keys / "red"), "plate_digest": DIGEST},
        "recorder": {"folder": str(folder / "drive")},
        "hmi": {"port": free_port(socket.SOCK_STREAM), "token": TOKEN, "recordings": True},
    }
    file = folder / "car.yaml"
    file.write_text(yaml.safe_dump(config))
    return file


def run_with(
    box: BoxSettings,
    scenario: Scenario,
    folder: Path,
    *,
    box_is_on: bool = True,
    virtual_others: bool = False,
) -> RunLog:
    async def run() -> RunLog:
        bench = LiveTestbench(
            scenario,
            scenario.seed,
            folder / "run",
            {"red": box},
            virtual_others=virtual_others,
        )
        async with bench as testbench:
            if box_is_on:
                with running(box, scenario, folder, testbench.start_utc_s):
                    await testbench.run()
            else:
                await testbench.run()
        return testbench.log()

    return asyncio.run(run())


@pytest.mark.parametrize("virtual_others", [False, True])
def test_a_box_meets_the_expectations_of_a_process_and_can_be_replayed(
    box: BoxSettings, scenario: Scenario, tmp_path: Path, virtual_others: bool
) -> None:
    log = run_with(box, scenario, tmp_path, virtual_others=virtual_others)

    assert log.unjudged == {}
    (clock,) = log.clocks["red"]
    ahead_s = AHEAD_S if has_own_clock() else 0
    assert abs(clock.offset_s + ahead_s) <= clock.uncertainty_s
    assert min(clock.frames_from_box, clock.frames_to_box) > 50
    others = {"other car"} if virtual_others else set()
    assert {line.what for line in log.lateness} == {"ECU answer", "picture", "WSM"} | others
    drive = RecordedDrive([tmp_path / "run" / "box" / "red"])
    assert compare(drive).difference is None
    found = verdict(scenario, log)
    if found.was_late:
        pytest.skip(f"the rig itself was late: {'; '.join(found.invalid)}")
    assert (found.failures, found.invalid) == ((), ())
    assert found.outcome is Outcome.PASSED
    assert {"received", "alarm", "chain"} <= {line.hop for line in ledger(log)}


def test_a_box_that_the_rig_starts_and_whose_power_it_cuts_is_judged_over_both_starts(
    box: BoxSettings, tmp_path: Path
) -> None:
    scenario = load_scenario("power-cut")
    process = tmp_path / "process"
    starts = f"echo $$ > {process}; exec {sys.executable} -m onboard run {tmp_path}/car.yaml"
    commands: dict[str, object] = {
        "fetch": None,
        "start": ("sh", "-c", starts),
        "stop": ("sh", "-c", f"kill $(cat {process})"),
        "power": PowerSettings(
            cut=("sh", "-c", f"kill -9 $(cat {process})"),
            restore=("sh", "-c", f"sh -c '{starts}' 2> {tmp_path}/car.log &"),
        ),
    }
    config = yaml.safe_load(configured(box, scenario, tmp_path).read_text())
    (tmp_path / "token").write_text(TOKEN)
    url = f"http://127.0.0.1:{config['hmi']['port']}"
    commands["page"] = PageSettings(url=url, token_file=tmp_path / "token")
    log = run_with(
        box.model_copy(update=commands), scenario, tmp_path, box_is_on=False, virtual_others=True
    )

    assert log.unjudged == {}
    assert len(log.clocks["red"]) == 2
    assert len(list((tmp_path / "run" / "box" / "red").iterdir())) == 2
    found = verdict(scenario, log)
    if found.was_late:
        pytest.skip(f"the rig itself was late: {'; '.join(found.invalid)}")
    assert (found.failures, found.invalid) == ((), ())


def test_a_box_that_is_off_is_named_with_what_it_does_not_do(
    box: BoxSettings, scenario: Scenario, tmp_path: Path
) -> None:
    impatient = box.model_copy(update={"ready_within_s": 0.1})
    with pytest.raises(BoxNotReadyError) as found:
        run_with(impatient, scenario, tmp_path, box_is_on=False)
    assert "red: the box is not ready after 0.1 s" in str(found.value)
    for wire in ("bus: it has requested", "camera: it has taken no", "radio: no BSM"):
        assert wire in str(found.value)


def test_the_doctor_finds_a_box_at_work(
    box: BoxSettings, scenario: Scenario, tmp_path: Path
) -> None:
    with running(box, scenario, tmp_path, time.time()):
        found = examine_box(tmp_path / "red.yaml", tmp_path / "out")
    of_box = [each for each in found if each.subject != "rig"]
    wrong = [each for each in of_box if each.level is FindingLevel.MISSING]
    if wrong and of_box != found:
        pytest.skip(f"the rig itself was late: {found}")
    assert wrong == []
    subjects = [each.subject for each in of_box]
    assert subjects == [
        *("program", "bus", "camera", "radio", "clock"),
        *("recording", "configuration", "group"),
    ]


def in_a_second(scenario: Scenario) -> Scenario:
    """One second of a scenario, with its first expectation."""
    soon = scenario.expect[0].model_copy(update={"by_s": 0.5})
    return scenario.model_copy(update={"duration_s": 1.0, "expect": (soon,)})


def test_the_recording_of_another_drive_is_not_judged(
    box: BoxSettings, scenario: Scenario, tmp_path: Path
) -> None:
    (tmp_path / "other").mkdir()
    drive = Path(__file__).parents[2] / "drives" / "live.mcap"
    shutil.copy(drive, tmp_path / "other" / "20260101T000000.000Z-0000.mcap")
    other = box.model_copy(update={"recording": tmp_path / "other", "fetch": ("true",)})
    brief = in_a_second(scenario)
    log = run_with(other, brief, tmp_path)
    assert "frames of the box are not in its recording" in log.unjudged["red"]
    found = verdict(brief, log)
    assert (found.outcome, found.failures) == (Outcome.INVALID, ())


def test_a_box_whose_recording_cannot_be_fetched_is_not_judged(
    box: BoxSettings, scenario: Scenario, tmp_path: Path
) -> None:
    off = box.model_copy(update={"fetch": ("false",)})
    brief = in_a_second(scenario)
    log = run_with(off, brief, tmp_path)
    assert log.unjudged == {"red": "fetch: false: exit code 1"}
    assert verdict(brief, log).outcome is Outcome.INVALID


def test_a_car_can_be_the_only_process_among_those_that_the_rig_steps(
    scenario: Scenario, tmp_path: Path
) -> None:
    async def run() -> RunLog:
        bench = LiveTestbench(
            scenario, scenario.seed, tmp_path, virtual_others=True, daemons={"red"}
        )
        async with bench as testbench:
            assert set(testbench.pages) == {"engineer", "red"}
            await testbench.run()
        return testbench.log()

    found = verdict(scenario, asyncio.run(run()))

    if found.was_late:
        pytest.skip(f"the rig itself was late: {'; '.join(found.invalid)}")
    assert (found.failures, found.invalid) == ((), ())
