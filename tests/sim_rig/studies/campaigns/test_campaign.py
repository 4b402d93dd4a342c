"""A campaign has the same results in one process, in many, resumed, and with failing workers."""

import fcntl
import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from distributed import LocalCluster

from onboard.settings import Settings
from sim_rig.studies.campaigns import campaign
from sim_rig.studies.campaigns.campaign import CampaignError, StoredRow, Workers, run_campaign

NUMBERS = range(12)


class DiceSettings(Settings):
    sides: int = 6
    fatal_once: str = ""
    """A file that run 5 writes before it kills its process; if it exists, run 5 succeeds."""
    always_fatal: bool = False


def throw(settings: DiceSettings, number: int) -> StoredRow:
    once = Path(settings.fatal_once)
    if settings.always_fatal or (number == 5 and settings.fatal_once and not once.exists()):
        once.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    rng = np.random.default_rng([settings.sides, number])
    return {"eyes": int(rng.integers(settings.sides)) + 1, "share": float(rng.random())}


def wait_forever(settings: DiceSettings, number: int) -> StoredRow:
    """Run 0 ends, the others last until they are interrupted."""
    if number:
        signal.pause()
    return throw(settings, number)


def interrupt_the_campaign(settings: DiceSettings, number: int) -> StoredRow:
    os.kill(os.getppid(), signal.SIGINT)
    signal.pause()
    return {}


def test_a_single_run_has_the_result_that_it_has_in_the_campaign(tmp_path: Path) -> None:
    settings = DiceSettings()

    rows = run_campaign(throw, settings, NUMBERS, tmp_path / "all", Workers())

    assert rows[7] == throw(settings, 7)
    assert run_campaign(throw, settings, [7], tmp_path / "one", Workers()) == [rows[7]]


def test_an_interrupted_campaign_is_resumed(tmp_path: Path) -> None:
    whole = run_campaign(throw, DiceSettings(), NUMBERS, tmp_path / "whole", Workers())
    run_campaign(throw, DiceSettings(), range(4), tmp_path / "cut", Workers())
    stored = tmp_path / "cut" / "runs.jsonl"
    stored.write_text(stored.read_text()[:-9])  # Run 3 was being written.

    resumed = run_campaign(throw, DiceSettings(), NUMBERS, tmp_path / "cut", Workers())

    assert resumed == whole
    assert stored.read_text() == (tmp_path / "whole" / "runs.jsonl").read_text()


def test_runs_with_other_settings_are_an_error(tmp_path: Path) -> None:
    run_campaign(throw, DiceSettings(), range(2), tmp_path, Workers())

    with pytest.raises(CampaignError, match="other settings"):
        run_campaign(throw, DiceSettings(sides=20), range(2), tmp_path, Workers())


def test_runs_without_their_settings_are_an_error(tmp_path: Path) -> None:
    """As of a folder of which only the runs were copied."""
    run_campaign(throw, DiceSettings(), NUMBERS, tmp_path, Workers())
    (tmp_path / "campaign.yaml").unlink()
    with pytest.raises(CampaignError, match="holds runs with other settings"):
        run_campaign(throw, DiceSettings(sides=20), NUMBERS, tmp_path, Workers())


def test_settings_may_be_corrected_in_a_folder_without_runs(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="high <= 0"):
        run_campaign(throw, DiceSettings(sides=0), range(2), tmp_path, Workers())

    corrected = run_campaign(throw, DiceSettings(), range(2), tmp_path, Workers())

    assert corrected == [throw(DiceSettings(), number) for number in range(2)]
    with pytest.raises(CampaignError, match="other settings"):
        run_campaign(throw, DiceSettings(sides=20), range(2), tmp_path, Workers())


@pytest.mark.long
def test_a_killed_worker_does_not_change_the_results(tmp_path: Path) -> None:
    settings = DiceSettings(fatal_once=str(tmp_path / "killed"))

    rows = run_campaign(throw, settings, NUMBERS, tmp_path / "a", Workers(processes=2))

    assert (tmp_path / "killed").exists()
    assert rows == run_campaign(throw, settings, NUMBERS, tmp_path / "b", Workers())


def test_an_invalid_line_is_an_error(tmp_path: Path) -> None:
    run_campaign(throw, DiceSettings(), range(2), tmp_path, Workers())
    stored = tmp_path / "runs.jsonl"
    stored.write_bytes(stored.read_bytes() + b"\xff\x00\n")

    with pytest.raises(CampaignError, match=r"runs\.jsonl, line 3: not a run"):
        run_campaign(throw, DiceSettings(), range(2), tmp_path, Workers())


def test_two_campaigns_in_one_folder_are_an_error(tmp_path: Path) -> None:
    run_campaign(throw, DiceSettings(), range(2), tmp_path, Workers())

    with (tmp_path / "runs.jsonl").open() as others:
        fcntl.flock(others, fcntl.LOCK_EX)
        with pytest.raises(CampaignError, match="another process executes these runs now"):
            run_campaign(throw, DiceSettings(), range(3), tmp_path, Workers())
    run_campaign(throw, DiceSettings(), range(3), tmp_path, Workers())


def test_a_full_disk_loses_no_finished_run(tmp_path: Path) -> None:
    whole = run_campaign(throw, DiceSettings(), NUMBERS, tmp_path / "whole", Workers())
    room = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (250, room[1]))
    try:
        with pytest.raises(OSError, match="too large"):
            run_campaign(throw, DiceSettings(), NUMBERS, tmp_path / "a", Workers())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, room)

    assert (tmp_path / "a" / "runs.jsonl").stat().st_size == 250
    assert run_campaign(throw, DiceSettings(), NUMBERS, tmp_path / "a", Workers()) == whole


@contextmanager
def process_group(*command: str) -> Iterator[subprocess.Popen[str]]:
    """A process whose group ends with the block, however that ends."""
    folder = Path(__file__).parents[4]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, start_new_session=True, cwd=folder
    ) as process:
        try:
            yield process
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.long
@pytest.mark.parametrize("processes", [1, 2])
def test_an_interrupted_campaign_ends_at_once_and_states_the_stored_runs(
    tmp_path: Path, processes: int
) -> None:
    code = (
        "from tests.sim_rig.studies.campaigns.test_campaign import *\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # ignored in the background
        f"run_campaign(wait_forever, DiceSettings(), range(30), Path({str(tmp_path)!r}),"
        f" Workers({processes}))"
    )
    stored = tmp_path / "runs.jsonl"
    with process_group(sys.executable, "-c", code) as process:
        while process.poll() is None and not (stored.exists() and stored.stat().st_size):
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        _, output = process.communicate(timeout=60.0)

    assert process.returncode == -signal.SIGINT
    assert f"of 30 runs are stored in {tmp_path}; the same command resumes" in output
    assert "SpawnProcess" not in output  # no worker writes anything


@pytest.mark.long
def test_an_interrupt_ends_a_campaign_of_many_runs_as_soon_as_one_runs(tmp_path: Path) -> None:
    code = (
        "from tests.sim_rig.studies.campaigns.test_campaign import *\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # ignored in the background
        f"run_campaign(interrupt_the_campaign, DiceSettings(), range(20_000),"
        f" Path({str(tmp_path)!r}), Workers(2))"
    )
    with process_group(sys.executable, "-c", code) as process:
        _, output = process.communicate(timeout=60.0)

    assert process.returncode == -signal.SIGINT
    assert "0 of 20000 runs are stored" in output
    assert "SpawnProcess" not in output  # no worker writes anything


@pytest.mark.long
def test_workers_that_always_fail_are_an_error(tmp_path: Path) -> None:
    settings = DiceSettings(fatal_once=str(tmp_path / "killed"), always_fatal=True)

    with pytest.raises(CampaignError, match="fail repeatedly"):
        run_campaign(throw, settings, range(2), tmp_path / "a", Workers(processes=2))


@contextmanager
def cluster_of_two(folder: Path) -> Iterator[Workers]:
    """A Dask scheduler and two workers on this machine."""
    with LocalCluster(  # type: ignore[no-untyped-call]
        n_workers=2,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
        local_directory=folder,
    ) as cluster:
        yield Workers(dask=cluster.scheduler_address)


@pytest.mark.long
def test_a_cluster_has_the_same_results(tmp_path: Path) -> None:
    with cluster_of_two(tmp_path) as workers:
        rows = run_campaign(throw, DiceSettings(), NUMBERS, tmp_path / "a", workers)

    assert rows == run_campaign(throw, DiceSettings(), NUMBERS, tmp_path / "b", Workers())


@pytest.mark.long
def test_a_killed_worker_of_a_cluster_does_not_change_the_results(tmp_path: Path) -> None:
    settings = DiceSettings(fatal_once=str(tmp_path / "killed"))

    with cluster_of_two(tmp_path) as workers:
        rows = run_campaign(throw, settings, NUMBERS, tmp_path / "a", workers)

    assert (tmp_path / "killed").exists()
    assert rows == run_campaign(throw, settings, NUMBERS, tmp_path / "b", Workers())
    lines = (tmp_path / "a" / "runs.jsonl").read_text().splitlines()
    assert sorted(json.loads(line)["run"] for line in lines) == list(NUMBERS)  # each once


@pytest.mark.long
def test_a_cluster_without_workers_that_ends_is_reported_in_two_more_lines(tmp_path: Path) -> None:
    scheduler_file = tmp_path / "scheduler.json"
    code = (
        "from sim_rig.studies.campaigns import campaign\n"
        "from tests.sim_rig.studies.campaigns.test_campaign import *\n"
        "campaign.DASK_TIMEOUT_S = 3.0\n"  # the lost one is looked for that long
        "try:\n"
        f"    run_campaign(throw, DiceSettings(), NUMBERS, Path({str(tmp_path)!r}),"
        " Workers(dask=sys.argv[1]))\n"
        "except CampaignError as error:\n"
        "    print(error, file=sys.stderr)"
    )
    serve = (
        "-m",
        "dask",
        "scheduler",
        "--host=127.0.0.1",
        "--port=0",
        "--dashboard-address=127.0.0.1:0",
    )
    with process_group(
        sys.executable, *serve, "--scheduler-file", str(scheduler_file)
    ) as scheduler:
        while scheduler.poll() is None and not (
            scheduler_file.exists() and scheduler_file.read_text().endswith("}")
        ):
            time.sleep(0.02)
        address = json.loads(scheduler_file.read_text())["address"]
        with process_group(sys.executable, "-c", code, address) as process:
            assert process.stderr is not None
            process.stderr.readline()  # how many runs
            waiting = process.stderr.readline()
            os.killpg(scheduler.pid, signal.SIGKILL)
            _, ending = process.communicate(timeout=60.0)

    assert waiting == (
        f"waiting for a worker: none is connected to the Dask scheduler at {address}\n"
    )
    assert ending == (f"the Dask scheduler at {address} has gone; the finished runs are stored\n")


def test_a_missing_cluster_is_a_user_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign, "DASK_TIMEOUT_S", 0.3)
    with pytest.raises(CampaignError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        run_campaign(throw, DiceSettings(), [1], tmp_path, Workers(dask="tcp://127.0.0.1:9"))
