"""Thousands of runs: spread over processes or a cluster, kept one by one, resumed where they ended.

A run is a function of settings and a number, and takes its seed from them; so run 17 alone gives
what it gave in the campaign, and an interrupted campaign ends like one that was not. What a run
gives is kept as one line of `runs.jsonl` as soon as it is known.
"""

import json
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

import yaml
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from onboard.errors import UserError
from onboard.garbage import keep_collection_short
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
        CampaignError: the folder holds a campaign with other settings, or workers keep dying.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _claim(folder, f"{run.__module__}.{run.__qualname__}", settings)
    done = _read(folder / "runs.jsonl")
    missing = [number for number in numbers if number not in done]
    with (folder / "runs.jsonl").open("a", encoding="utf-8") as kept, _bar(folder.name) as advance:
        advance(len(numbers), len(numbers) - len(missing))
        for number, row in _spread(run, settings, missing, workers):
            done[number] = json.loads(json.dumps(row))
            kept.write(json.dumps({"run": number} | row) + "\n")
            kept.flush()
            advance(len(numbers), 1)
    return [done[number] for number in numbers]


def _claim(folder: Path, name: str, settings: Settings) -> None:
    """One folder is for one campaign; only a setting `runs`, how many there are, may change."""
    same = settings.model_dump(mode="json", exclude={"runs"})
    claim = yaml.safe_dump({"run": name, "settings": same})
    path = folder / "campaign.yaml"
    if path.exists() and path.read_text("utf-8") != claim:
        raise CampaignError(f"{folder} holds runs with other settings: remove it, or take another")
    path.write_text(claim, "utf-8")


def _read(path: Path) -> dict[int, Row]:
    """The runs that are kept; a last line that was cut off is cut away."""
    if not path.exists():
        return {}
    whole, end, cut = path.read_text("utf-8").rpartition("\n")
    if cut:
        path.write_text(whole + end, "utf-8")
    rows = [json.loads(line) for line in whole.splitlines()]
    return {row.pop("run"): row for row in rows}


def _spread(
    run: "Run[SettingsT]", settings: SettingsT, numbers: Sequence[int], workers: Workers
) -> Iterator[tuple[int, Row]]:
    if workers.dask is not None:
        yield from _on_dask(run, settings, numbers, workers.dask)
    elif workers.processes == 1:
        keep_collection_short()
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
                    processes,
                    mp_context=get_context("spawn"),
                    initializer=keep_collection_short,
                ) as pool,
            ):
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
        for _, (number, row) in distributed.as_completed(futures, with_results=True):  # type: ignore[no-untyped-call]
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
