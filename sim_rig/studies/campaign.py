"""Thousands of runs: spread over processes or a cluster, kept one by one, resumed where they ended.

A run is a function of settings and a number, and takes its seed from them; so run 17 alone gives
what it gave in the campaign, and an interrupted campaign ends like one that was not. What a run
gives is kept as one line of `runs.jsonl` as soon as it is known.
"""

import fcntl
import json
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.connection import wait
from pathlib import Path
from typing import IO, Any, TypeVar

import yaml
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from onboard.errors import UserError
from onboard.runtime.gc_tuning import freeze_start_up_objects
from onboard.settings import Settings

Row = dict[str, Any]
"""What a run gives: what JSON can hold, with floats as they are."""
SettingsT = TypeVar("SettingsT", bound=Settings)
Run = Callable[[SettingsT, int], Row]
"""One run; must be found by its name in its module, so that other processes can call it."""

DASK_ANSWERS_S = 10.0
_MOST_BREAKDOWNS = 3
"""In a row, without a run between them."""


class CampaignError(UserError):
    """Names what the user can do."""


@dataclass(frozen=True, slots=True)
class Workers:
    """Who does the runs."""

    processes: int = 1
    """With one, the runs are done here."""
    dask: str | None = None
    """Address of a Dask scheduler, in the place of processes."""


def run_campaign(
    run: "Run[SettingsT]",
    settings: SettingsT,
    numbers: Sequence[int],
    folder: Path,
    workers: Workers,
) -> list[Row]:
    """Do those runs that `folder` does not hold yet; returns all, in the order of `numbers`.

    Raises:
        CampaignError: the folder holds a campaign with other settings or what is no campaign,
            another process is at it, or workers keep dying.
        OSError: nothing can be written there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "runs.jsonl").open("a", encoding="utf-8") as kept, _bar(folder.name) as advance:
        _lock(kept, folder)
        done = kept_runs(folder)
        _claim(folder, f"{run.__module__}.{run.__qualname__}", settings, holds_runs=bool(done))
        _cut(folder / "runs.jsonl")
        missing = [number for number in numbers if number not in done]
        advance(len(numbers), len(numbers) - len(missing))
        try:
            for number, row in _spread(run, settings, missing, workers):
                done[number] = json.loads(json.dumps(row))
                kept.write(json.dumps({"run": number} | row) + "\n")
                kept.flush()
                advance(len(numbers), 1)
        except KeyboardInterrupt:
            finished = sum(number in done for number in numbers)
            Console(stderr=True, highlight=False, soft_wrap=True).print(
                f"interrupted: {finished} of {len(numbers)} runs are kept in {folder};"
                " the same command goes on from there"
            )
            raise
    return [done[number] for number in numbers]


def _lock(kept: IO[str], folder: Path) -> None:
    """Until the file is closed, no other process may do runs of this folder."""
    try:
        fcntl.flock(kept, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise CampaignError(f"{folder}: another process is doing these runs now") from error


def _claim(folder: Path, name: str, settings: Settings, *, holds_runs: bool) -> None:
    """One folder is for one campaign; only a setting `runs`, how many there are, may change.

    Where no run was done, as after a mistake in the settings, others may take it over.
    """
    same = settings.model_dump(mode="json", exclude={"runs"})
    claim = yaml.safe_dump({"run": name, "settings": same})
    path = folder / "campaign.yaml"
    if path.exists() and path.read_bytes() == claim.encode():
        return
    if path.exists() and holds_runs:
        raise CampaignError(f"{folder} holds runs with other settings: remove it, or take another")
    begun = path.with_suffix(".new")  # who is killed here leaves no half of a claim
    begun.write_text(claim, "utf-8")
    begun.replace(path)


def kept_runs(folder: Path) -> dict[int, Row]:
    """The runs that `folder` holds by number, without a last one that was cut off.

    Raises:
        CampaignError: a line is no run.
        OSError: it cannot be read.
    """
    path = folder / "runs.jsonl"
    rows: dict[int, Row] = {}
    for line, text in enumerate(path.read_bytes().split(b"\n")[:-1], 1):
        try:
            row = json.loads(text)
            rows[row.pop("run")] = row
        except (ValueError, LookupError, AttributeError, TypeError) as error:
            raise CampaignError(f"{path}, line {line}: no run: remove it") from error
    return rows


def _cut(path: Path) -> None:
    """Cut away a last line that was not written to its end."""
    whole, end, cut = path.read_bytes().rpartition(b"\n")
    if cut:
        os.truncate(path, len(whole + end))


def _spread(
    run: "Run[SettingsT]", settings: SettingsT, numbers: Sequence[int], workers: Workers
) -> Iterator[tuple[int, Row]]:
    if workers.dask is not None:
        yield from _on_dask(run, settings, numbers, workers.dask)
    elif workers.processes == 1:
        freeze_start_up_objects()
        yield from ((number, run(settings, number)) for number in numbers)
    else:
        yield from _in_processes(run, settings, numbers, workers.processes)


def _in_processes(
    run: "Run[SettingsT]", settings: SettingsT, numbers: Sequence[int], processes: int
) -> Iterator[tuple[int, Row]]:
    """A process that dies takes the pool with it: the runs that are missing get a new one."""
    left, breakdowns = list(numbers), 0
    while left:
        try:
            with (
                _one_thread_each(),
                ProcessPoolExecutor(
                    processes, mp_context=get_context("spawn"), initializer=_become_worker
                ) as pool,
                _ended_with_us(),
            ):
                with _deaf_to_interrupts():
                    futures = {pool.submit(run, settings, number): number for number in left}
                for future in as_completed(futures):
                    row = future.result()
                    left.remove(futures[future])
                    breakdowns = 0
                    yield futures[future], row
        except BrokenProcessPool as error:
            breakdowns += 1
            if breakdowns == _MOST_BREAKDOWNS:
                raise CampaignError(
                    f"worker processes keep dying (out of memory?); {len(left)} runs are missing, "
                    "the others are kept"
                ) from error


def _become_worker() -> None:
    """A worker whose campaign was killed has nobody to tell its results: it ends."""
    freeze_start_up_objects()
    parent = parent_process()
    assert parent is not None  # noqa: S101 (it was started by one)

    def end_with_it() -> None:
        wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=end_with_it, daemon=True).start()


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Processes started inside leave Ctrl-C, which a terminal sends to all, to this one."""
    if threading.current_thread() is not threading.main_thread():
        yield  # which is the only one that may say what a signal does
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _ended_with_us() -> Iterator[None]:
    """Do not wait for processes started inside, nor for what they have yet to do, if we fail."""
    before = set(active_children())
    try:
        yield
    except BaseException:
        for process in set(active_children()) - before:
            process.terminate()
        raise


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes started inside do not share their cores out among threads of linear algebra."""
    before = {name: os.environ.get(name) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    os.environ.update(dict.fromkeys(before, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _on_dask(
    run: "Run[SettingsT]", settings: SettingsT, numbers: Sequence[int], address: str
) -> Iterator[tuple[int, Row]]:
    """Dask gives the runs of a worker that dies to another one by itself."""
    try:
        import distributed  # noqa: PLC0415 (of the extra `cluster`)
    except ImportError as error:
        raise CampaignError("--dask needs the extra: pip install 'onboard[cluster]'") from error
    try:
        client = distributed.Client(address, timeout=DASK_ANSWERS_S)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise CampaignError(f"no Dask scheduler answers at {address}: {error}") from error
    with client:
        futures = [client.submit(_numbered, run, settings, number) for number in numbers]
        for future in distributed.as_completed(futures):  # type: ignore[no-untyped-call]
            try:
                number, row = future.result()
            except (CancelledError, OSError, TimeoutError) as error:
                raise CampaignError(
                    f"the Dask scheduler at {address} has gone; the runs that were done are kept"
                ) from error
            except distributed.KilledWorker as error:
                raise CampaignError(
                    f"workers of the Dask scheduler at {address} keep dying (out of memory?);"
                    " the runs that were done are kept"
                ) from error
            yield number, row


def _numbered(run: "Run[SettingsT]", settings: SettingsT, number: int) -> tuple[int, Row]:
    return number, run(settings, number)


@contextmanager
def _bar(name: str) -> Iterator[Callable[[int, int], None]]:
    """A bar on the terminal; elsewhere it is silent."""
    console = Console(stderr=True)
    columns = (TextColumn(name), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task(name)

        def advance(total: int, by: int) -> None:
            progress.update(task, total=total, advance=by)

        yield advance
