"""Runs of a study: distributed over processes or a cluster, stored one by one, and resumable.

A run is a function of settings and a number, from which it takes its seed. So run 17 alone has the
result that it has in the campaign, and an interrupted campaign, when it is resumed, ends with the
same results. The result of a run is one line of `runs.jsonl`, written as soon as the run ends.
"""

import fcntl
import json
import logging
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor
from concurrent.futures import wait as wait_for_runs
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.connection import wait
from pathlib import Path
from typing import IO, Any, TypeVar

import yaml

from onboard.errors import UserError
from onboard.runtime.gc_tuning import freeze_start_up_objects
from onboard.settings import Settings
from sim_rig.studies.campaigns.progress import campaign_progress, report

StoredRow = dict[str, Any]
"""Result of a run, as a line of `runs.jsonl` holds it."""
SettingsT = TypeVar("SettingsT", bound=Settings)
Run = Callable[[SettingsT, int], StoredRow]
"""One run by its number, which other processes can import, as a function at the top of a module."""

DASK_TIMEOUT_S = 10.0
_MOST_FAILURES = 3
"""Consecutive failures of the worker pool, without a finished run between them."""


class CampaignError(UserError):
    """An error of a campaign that the user can resolve."""


@dataclass(frozen=True, slots=True)
class Workers:
    """Processes that execute the runs."""

    processes: int = 1
    """With 1, this process executes the runs."""
    dask: str | None = None
    """Address of a Dask scheduler, instead of processes."""


def run_campaign(
    run: "Run[SettingsT]",
    settings: SettingsT,
    numbers: Sequence[int],
    folder: Path,
    workers: Workers,
    *,
    name: str = "",
) -> list[StoredRow]:
    """Execute the runs that `folder` does not contain yet.

    Args:
        run: one run.
        settings: of every run.
        numbers: of the runs.
        folder: of `runs.jsonl` and `campaign.yaml`.
        workers: processes or cluster.
        name: of the campaign; by default that of the function.

    Returns:
        The results of all runs, in the order of `numbers`.

    Raises:
        CampaignError: the folder contains runs with other settings or invalid lines, another
            process uses it, or workers fail repeatedly.
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "runs.jsonl").open("a", encoding="utf-8") as file:
        _lock(file, folder)
        done = stored_runs(folder)
        name = name or f"{run.__module__}.{run.__qualname__}"
        _reserve(folder, name, settings, holds_runs=bool(done))
        _remove_incomplete_line(folder / "runs.jsonl")
        missing = [number for number in numbers if number not in done]
        stored = len(numbers) - len(missing)
        with campaign_progress(name, len(numbers), stored) as advance:
            try:
                for number, row in _execute(run, settings, missing, workers):
                    done[number] = json.loads(json.dumps(row))
                    file.write(json.dumps({"run": number} | row) + "\n")
                    file.flush()
                    advance()
            except KeyboardInterrupt:
                finished = sum(number in done for number in numbers)
                report(
                    f"interrupted: {finished} of {len(numbers)} runs are stored in {folder};"
                    " the same command resumes there"
                )
                raise
    return [done[number] for number in numbers]


def _lock(file: IO[str], folder: Path) -> None:
    """Lock the folder against other processes until the file is closed."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise CampaignError(f"{folder}: another process executes these runs now") from error


def _reserve(folder: Path, name: str, settings: Settings, *, holds_runs: bool) -> None:
    """Reserve the folder for one campaign; only its setting `runs`, their number, may change.

    A folder without runs, as after a mistake in the settings, may be used with other settings.
    """
    same = settings.model_dump(mode="json", exclude={"runs"})
    entry = yaml.safe_dump({"run": name, "settings": same})
    path = folder / "campaign.yaml"
    if path.exists() and path.read_bytes() == entry.encode():
        return
    if holds_runs:
        raise CampaignError(f"{folder} holds runs with other settings: remove it, or use another")
    begun = path.with_suffix(".new")  # so that an interruption leaves no incomplete file
    begun.write_text(entry, "utf-8")
    begun.replace(path)


def stored_runs(folder: Path) -> dict[int, StoredRow]:
    """The stored runs by number, without an incomplete last line.

    Raises:
        CampaignError: a line is not a run.
        OSError: the file cannot be read.
    """
    path = folder / "runs.jsonl"
    rows: dict[int, StoredRow] = {}
    for line, text in enumerate(path.read_bytes().split(b"\n")[:-1], 1):
        try:
            row = json.loads(text)
            rows[row.pop("run")] = row
        except (ValueError, LookupError, AttributeError, TypeError) as error:
            raise CampaignError(f"{path}, line {line}: not a run: remove it") from error
    return rows


def _remove_incomplete_line(path: Path) -> None:
    """Remove an incomplete last line."""
    complete, end, incomplete = path.read_bytes().rpartition(b"\n")
    if incomplete:
        os.truncate(path, len(complete + end))


def _execute(
    run: "Run[SettingsT]", settings: SettingsT, numbers: Sequence[int], workers: Workers
) -> Iterator[tuple[int, StoredRow]]:
    if workers.dask is not None:
        yield from _on_dask(run, settings, numbers, workers.dask)
    elif workers.processes == 1:
        freeze_start_up_objects()
        yield from ((number, run(settings, number)) for number in numbers)
    else:
        yield from _in_processes(run, settings, numbers, workers.processes)


def _in_processes(
    run: "Run[SettingsT]", settings: SettingsT, numbers: Sequence[int], processes: int
) -> Iterator[tuple[int, StoredRow]]:
    """Execute runs in a process pool; a pool that a dying process breaks is replaced."""
    left, failures = list(numbers), 0
    while left:
        try:
            with (
                _single_threaded(),
                ProcessPoolExecutor(
                    processes, mp_context=get_context("spawn"), initializer=_become_worker
                ) as pool,
                _end_on_error(),
            ):
                for number, row in _completed(pool, 2 * processes, run, settings, tuple(left)):
                    left.remove(number)
                    failures = 0
                    yield number, row
        except BrokenProcessPool as error:
            failures += 1
            if failures == _MOST_FAILURES:
                raise CampaignError(
                    f"worker processes fail repeatedly (out of memory?); {len(left)} runs are"
                    " missing, the others are stored"
                ) from error


def _completed(
    pool: ProcessPoolExecutor,
    submitted_at_most: int,
    run: "Run[SettingsT]",
    settings: SettingsT,
    numbers: Iterable[int],
) -> Iterator[tuple[int, StoredRow]]:
    """Yield runs as they end; few are submitted ahead, so that the first is stored early."""
    waiting = iter(numbers)
    submitted: dict[Future[StoredRow], int] = {}
    while True:
        for number in islice(waiting, submitted_at_most - len(submitted)):
            with _delay_interrupt():
                submitted[pool.submit(run, settings, number)] = number
        if not submitted:
            return
        for future in wait_for_runs(submitted, return_when=FIRST_COMPLETED).done:
            yield submitted.pop(future), future.result()


def _become_worker() -> None:
    """Prepare a worker process: it ignores Ctrl-C, and ends when its parent process ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    freeze_start_up_objects()
    parent = parent_process()
    assert parent is not None  # noqa: S101 (it was started by one)

    def end_with_parent() -> None:
        wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


@contextmanager
def _delay_interrupt() -> Iterator[None]:
    """Delay Ctrl-C to the end of the block, and keep it from processes that start inside.

    A child process inherits the blocked signal, so Ctrl-C cannot end it before it ignores it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread gets signals
        return
    delayed: list[int] = []
    # The kernel gives a signal that this thread blocks to another thread of the process.
    before = signal.signal(signal.SIGINT, lambda number, _: delayed.append(number))
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        signal.signal(signal.SIGINT, before)
    if delayed:
        signal.raise_signal(signal.SIGINT)


@contextmanager
def _end_on_error() -> Iterator[None]:
    """On an error, end the processes started inside without waiting for their runs."""
    before = set(active_children())
    try:
        yield
    except BaseException:
        for process in set(active_children()) - before:
            process.terminate()
        raise


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Limit the linear algebra of processes started inside to one thread each."""
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
) -> Iterator[tuple[int, StoredRow]]:
    """Execute runs on a Dask cluster, which reassigns the runs of a worker that dies."""
    try:
        import distributed  # noqa: PLC0415 (of the extra `cluster`)
    except ImportError as error:
        raise CampaignError("--dask needs the extra: pip install 'onboard[cluster]'") from error
    try:
        client = distributed.Client(address, timeout=DASK_TIMEOUT_S)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise CampaignError(f"no Dask scheduler answers at {address}: {error}") from error
    # They log a lost scheduler with tracebacks, which the error below states in a line.
    for name in ("distributed.client", "distributed.batched", "distributed.core"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with client:
        if not client.nthreads():  # type: ignore[no-untyped-call]
            report(f"waiting for a worker: none is connected to the Dask scheduler at {address}")
        futures = [client.submit(_numbered, run, settings, number) for number in numbers]
        for future in distributed.as_completed(futures):  # type: ignore[no-untyped-call]
            try:
                number, row = future.result()
            except (CancelledError, OSError, TimeoutError) as error:
                raise CampaignError(
                    f"the Dask scheduler at {address} has gone; the finished runs are stored"
                ) from error
            except distributed.KilledWorker as error:
                raise CampaignError(
                    f"workers of the Dask scheduler at {address} fail repeatedly (out of memory?);"
                    " the finished runs are stored"
                ) from error
            yield number, row


def _numbered(run: "Run[SettingsT]", settings: SettingsT, number: int) -> tuple[int, StoredRow]:
    return number, run(settings, number)
