"""The computer of a box, by the user's commands: its start, its power, and a copy of its recording.

A car of a scenario on another computer of the user's is such a box, started by ssh.
"""

import asyncio
import time
from collections.abc import Awaitable
from dataclasses import dataclass
from pathlib import Path

from onboard.errors import UserError
from sim_rig.boxes.commands import failure, run_command, start_command
from sim_rig.boxes.page_download import download
from sim_rig.boxes.settings import BoxSettings

FETCHED_WITHIN_S = 120.0
"""Limit of the command that copies the black box."""
_WRITTEN_BEFORE_S = 5.0
"""Segments that the box wrote this long before the rig was started are copied too."""
SWITCHED_WITHIN_S = 10.0
"""Limit of the commands that switch the power, and of the one that stops the daemon."""


@dataclass(frozen=True, slots=True)
class TimeWithoutPower:
    """One power cut of a box, on the rig's clock."""

    cut_s: float
    """Start of the command that cuts the power."""
    off_s: float
    """End of that command."""
    restored_s: float
    """Start of the command that restores it."""


class BoxComputer:
    """Runs the commands of one box's file; one that is not given does nothing."""

    def __init__(self, car: str, box: BoxSettings, folder: Path) -> None:
        """Run nothing yet.

        Args:
            car: name of the box.
            box: its file.
            folder: for the output of `start`.
        """
        self.power_cuts: list[TimeWithoutPower] = []
        self._car = car
        self._box = box
        self._output = folder / f"{car}-start.log"
        self._started: asyncio.subprocess.Process | None = None
        self._began_s = self._cut_s = self._off_s = time.monotonic()

    async def start(self) -> None:
        """Run `start`, which may last as long as the run.

        Raises:
            UserError: it cannot be run.
        """
        if self._box.start is not None:
            with self._output.open("wb") as output:
                self._started = await start_command(f"{self._car}: start", self._box.start, output)

    @property
    def is_starting(self) -> bool:
        """Whether `start` still runs, as it does as long as its daemon, or until that is ready."""
        return self._started is not None and self._started.returncode is None

    def check(self) -> None:
        """Raise `UserError` if `start` has failed, with the last line that it printed."""
        if self._started is not None and self._started.returncode:
            assert self._box.start is not None  # noqa: S101 (it has been started)
            raise failure(
                f"{self._car}: start",
                self._box.start,
                self._started.returncode,
                self._output.read_bytes(),
            )

    async def stop(self) -> None:
        """Run `stop`, and end `start` if it still runs; afterwards there is nothing to stop.

        Raises:
            UserError: `stop` has failed.
        """
        started, self._started = self._started, None
        if started is None:
            return
        try:
            if self._box.stop is not None:
                await run_command(f"{self._car}: stop", self._box.stop, SWITCHED_WITHIN_S)
        finally:
            if started.returncode is None:
                started.terminate()
                try:
                    await asyncio.wait_for(started.wait(), SWITCHED_WITHIN_S)
                except TimeoutError:
                    started.kill()
                    await started.wait()

    async def cut(self) -> None:
        """Run `power.cut`.

        Raises:
            UserError: it has failed.
        """
        self._cut_s = time.monotonic()
        if self._box.power is not None:
            await run_command(f"{self._car}: power.cut", self._box.power.cut, SWITCHED_WITHIN_S)
        self._off_s = time.monotonic()

    async def restore(self) -> None:
        """Run `power.restore`.

        Raises:
            UserError: it has failed.
        """
        self.power_cuts.append(TimeWithoutPower(self._cut_s, self._off_s, time.monotonic()))
        if self._box.power is not None:
            command = self._box.power.restore
            await run_command(f"{self._car}: power.restore", command, SWITCHED_WITHIN_S)

    async def set_clock(self, utc_s: float) -> None:
        """Run `set_clock` with this UTC, s since 1970.

        Raises:
            UserError: it has failed.
        """
        if self._box.set_clock is not None:
            command = [word.replace("{utc}", f"{utc_s:.3f}") for word in self._box.set_clock]
            await run_command(f"{self._car}: set_clock", command, SWITCHED_WITHIN_S)

    async def finish(self) -> str | None:
        """Copy the recording, and end what was started.

        Returns:
            why there is no copy, as when the box is off; `None` if there is, or none is wanted.

        Raises:
            UserError: `stop` has failed.
        """
        if self._box.page is None:
            await self.stop()
            return await _failure_of(self.fetch())
        why = await _failure_of(self.download())
        await self.stop()
        return why

    async def download(self) -> None:
        """Copy the recording from the page of the box, whose daemon must still run.

        Raises:
            UserError: it has failed.
        """
        if self._box.page is not None and self._box.recording is not None:
            age_s = time.monotonic() - self._began_s + _WRITTEN_BEFORE_S
            await download("page", self._box.page, self._box.recording, age_s, FETCHED_WITHIN_S)

    async def fetch(self) -> None:
        """Run `fetch`.

        Raises:
            UserError: it has failed.
        """
        if self._box.fetch is not None and self._box.recording is not None:
            self._box.recording.parent.mkdir(parents=True, exist_ok=True)
            await run_command("fetch", self._box.fetch, FETCHED_WITHIN_S)


async def _failure_of(work: Awaitable[None]) -> str | None:
    try:
        await work
    except UserError as error:
        return str(error)
    return None
