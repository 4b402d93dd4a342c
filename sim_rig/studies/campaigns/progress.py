"""How far a study is, and how long it will still take: a bar on a terminal, else some lines."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

_FIRST_S = 3.0
"""Time until the first estimate at the earliest; until each further one it doubles."""


def report(text: str) -> None:
    """Write a line to stderr."""
    _console().print(text)


class ProgressLines:
    """Decides when a line is due, and what it says."""

    def __init__(self, name: str, total: int, stored: int, now: float) -> None:
        """Begin a campaign.

        Args:
            name: of the study.
            total: number of its runs.
            stored: those of them that are there already.
            now: the present time in s.
        """
        self._name, self._total, self._stored = name, total, stored
        self._finished = stored
        self._began_at = now
        self._interval_s = _FIRST_S

    def first(self) -> str:
        """Return the line before the first run."""
        stored = f", {self._stored} of them stored" if self._stored else ""
        runs = "1 run" if self._total == 1 else f"{self._total} runs"
        return f"{self._name}: {runs}{stored}"

    def receive_run(self, now: float) -> str | None:
        """Take that a run has finished; return the line that is due, if one is."""
        self._finished += 1
        took_s, left = now - self._began_at, self._total - self._finished
        if took_s < self._interval_s or not left:
            return None
        self._interval_s = 2.0 * took_s
        left_s = left * took_s / (self._finished - self._stored)
        finished = f"{self._finished} of {self._total} runs"
        return f"{self._name}: {finished}, about {duration(left_s)} left"


def duration(seconds: float) -> str:
    """Return a time in the unit in which it is read.

    >>> duration(59.6), duration(600.0), duration(9000.0)
    ('60 s', '10 min', '2.5 h')
    """
    if seconds < 100.0:
        return f"{math.ceil(seconds)} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


@contextmanager
def campaign_progress(name: str, total: int, stored: int) -> Iterator[Callable[[], None]]:
    """Show the progress of many runs; what is yielded is called after each."""
    console = _console()
    lines = ProgressLines(name, total, stored, time.monotonic())
    if stored < total:
        report(lines.first())
    columns = (TextColumn(name), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task(name, total=total, completed=stored)

        def advance() -> None:
            line = lines.receive_run(time.monotonic())
            if line is not None and not console.is_terminal:
                report(line)
            progress.update(task, advance=1)

        yield advance


@contextmanager
def run_progress(name: str, about_s: float) -> Iterator[None]:
    """Show that a study of one run is at work, and since when; `about_s` is what it takes."""
    console = _console()
    text = f"{name}: takes about {duration(about_s)}"
    if not console.is_terminal:
        report(text)
    columns = SpinnerColumn(), TextColumn(text), TimeElapsedColumn()
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        progress.add_task(name, total=None)
        try:
            yield
        except KeyboardInterrupt:
            report(f"{name}: interrupted, and nothing of it is stored")
            raise


def _console() -> Console:
    return Console(stderr=True, highlight=False, soft_wrap=True)
