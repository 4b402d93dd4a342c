"""A campaign ends the same however it is run: here, in processes, resumed, with dying workers."""

import fcntl
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
from sim_rig.studies import campaign
from sim_rig.studies.campaign import CampaignError, Row, Workers, run_campaign

NUMBERS = range(12)


class DiceSettings(Settings):
    sides: int = 6
    deadly: str = ""
    """A file that the fifth run writes before it takes its process down; with it, it lives."""
    always_deadly: bool = False


def throw(settings: DiceSettings, number: int) -> Row:
    once = Path(settings.deadly)
    if settings.always_deadly or (number == 5 and settings.deadly and not once.exists()):
        once.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    rng = np.random.default_rng([settings.sides, number])
    return {"eyes": int(rng.integers(settings.sides)) + 1, "share": float(rng.random())}


def linger(settings: DiceSettings, number: int) -> Row:
    """The first is done, the others last until they are ended."""
    if number:
        signal.pause()
    return throw(settings, number)


def test_one_run_alone_gives_what_it_gave_in_the_campaign(tmp_path: Path) -> None:
    settings = DiceSettings()

    rows = run_campaign(throw, settings, NUMBERS, tmp_path / "all", Workers())

    assert rows[7] == throw(settings, 7)
    assert run_campaign(throw, settings, [7], tmp_path / "one", Workers()) == [rows[7]]


def test_an_interrupted_campaign_is_resumed_where_it_ended(tmp_path: Path) -> None:
    whole = run_campaign(throw, DiceSettings(), NUMBERS, tmp_path / "whole", Workers())
    run_campaign(throw, DiceSettings(), range(4), tmp_path / "cut", Workers())
    kept = tmp_path / "cut" / "runs.jsonl"
    kept.write_text(kept.read_text()[:-9])  # Run 3 was being written.

    resumed = run_campaign(throw, DiceSettings(), NUMBERS, tmp_path / "cut", Workers())

    assert resumed == whole
    assert kept.read_text() == (tmp_path / "whole" / "runs.jsonl").read_text()


def test_runs_of_other_settings_are_not_mixed_in(tmp_path: Path) -> None:
    run_campaign(throw, DiceSettings(), range(2), tmp_path, Workers())

    with pytest.raises(CampaignError, match="other settings"):
        run_campaign(throw, DiceSettings(sides=20), range(2), tmp_path, Workers())


def test_a_mistake_that_left_no_run_may_be_corrected_in_its_folder(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="high <= 0"):
        run_campaign(throw, DiceSettings(sides=0), range(2), tmp_path, Workers())

    corrected = run_campaign(throw, DiceSettings(), range(2), tmp_path, Workers())

    assert corrected == [throw(DiceSettings(), number) for number in range(2)]
    with pytest.raises(CampaignError, match="other settings"):
        run_campaign(throw, DiceSettings(sides=20), range(2), tmp_path, Workers())


def test_a_worker_that_is_killed_changes_nothing(tmp_path: Path) -> None:
    settings = DiceSettings(deadly=str(tmp_path / "killed"))

    rows = run_campaign(throw, settings, NUMBERS, tmp_path / "a", Workers(processes=2))

    assert (tmp_path / "killed").exists()
    assert rows == run_campaign(throw, settings, NUMBERS, tmp_path / "b", Workers())


def test_a_file_that_holds_no_runs_is_told_of(tmp_path: Path) -> None:
    run_campaign(throw, DiceSettings(), range(2), tmp_path, Workers())
    kept = tmp_path / "runs.jsonl"
    kept.write_bytes(kept.read_bytes() + b"\xff\x00\n")

    with pytest.raises(CampaignError, match=r"runs\.jsonl, line 3: no run"):
        run_campaign(throw, DiceSettings(), range(2), tmp_path, Workers())


def test_two_campaigns_do_not_write_into_one_folder(tmp_path: Path) -> None:
    run_campaign(throw, DiceSettings(), range(2), tmp_path, Workers())

    with (tmp_path / "runs.jsonl").open() as others:
        fcntl.flock(others, fcntl.LOCK_EX)
        with pytest.raises(CampaignError, match="another process is doing these runs now"):
            run_campaign(throw, DiceSettings(), range(3), tmp_path, Workers())
    run_campaign(throw, DiceSettings(), range(3), tmp_path, Workers())


def test_a_full_disk_costs_nothing_that_was_done(tmp_path: Path) -> None:
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
    folder = Path(__file__).parents[2]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, start_new_session=True, cwd=folder
    ) as process:
        try:
            yield process
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.parametrize("processes", [1, 2])
def test_an_interrupted_campaign_ends_at_once_and_says_what_is_kept(
    tmp_path: Path, processes: int
) -> None:
    code = (
        "from tests.sim_rig.test_campaign import *\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # ignored in the background
        f"run_campaign(linger, DiceSettings(), range(30), Path({str(tmp_path)!r}),"
        f" Workers({processes}))"
    )
    kept = tmp_path / "runs.jsonl"
    with process_group(sys.executable, "-c", code) as process:
        while process.poll() is None and not (kept.exists() and kept.stat().st_size):
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        _, told = process.communicate(timeout=60.0)

    assert process.returncode == -signal.SIGINT
    assert f"of 30 runs are kept in {tmp_path}; the same command goes on" in told
    assert "SpawnProcess" not in told  # no worker has anything to say


def test_workers_that_always_die_are_told_of(tmp_path: Path) -> None:
    settings = DiceSettings(deadly=str(tmp_path / "killed"), always_deadly=True)

    with pytest.raises(CampaignError, match="keep dying"):
        run_campaign(throw, settings, range(2), tmp_path / "a", Workers(processes=2))


def test_a_cluster_gives_the_same(tmp_path: Path) -> None:
    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address=None,
        local_directory=tmp_path,
    ) as cluster:
        address = cluster.scheduler_address
        rows = run_campaign(throw, DiceSettings(), NUMBERS, tmp_path / "a", Workers(dask=address))

    assert rows == run_campaign(throw, DiceSettings(), NUMBERS, tmp_path / "b", Workers())


def test_a_cluster_that_is_not_there_is_the_users_mistake(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(campaign, "DASK_ANSWERS_S", 0.3)
    with pytest.raises(CampaignError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        run_campaign(throw, DiceSettings(), [1], tmp_path, Workers(dask="tcp://127.0.0.1:9"))
