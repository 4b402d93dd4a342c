"""Starts, watches and stops the child processes of a live run."""

import asyncio
import contextlib
import os
import signal
import sys
import time
from pathlib import Path

from onboard.errors import UserError

_LOOK_INTERVAL_S = 1.0
"""A process that is started while others are watched is watched after this time."""
_THREAD_COUNTS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
"""Environment variables with the number of threads of BLAS and OpenCV."""


class ProcessError(UserError):
    """A process did not start, or ended unexpectedly."""


class Processes:
    """Child processes by name; an asynchronous context that stops all of them at its end."""

    def __init__(self, folder: Path, stopped_within_s: float = 5.0) -> None:
        """Write the standard error of each process to `<name>.log` in `folder`.

        A process that has not ended `stopped_within_s` after SIGTERM gets SIGKILL.
        """
        self._folder = folder
        self._stopped_within_s = stopped_within_s
        self._running: dict[str, asyncio.subprocess.Process] = {}
        self._ends: dict[str, asyncio.Task[int]] = {}

    async def start(
        self, name: str, *arguments: str, with_pipes: bool = False
    ) -> asyncio.subprocess.Process:
        """Run Python.

        Args:
            name: name of the process.
            arguments: its command line, without the interpreter.
            with_pipes: whether its standard input and output are pipes.
        """
        return await self.start_program(name, sys.executable, *arguments, with_pipes=with_pipes)

    async def start_program(
        self, name: str, *command: str, with_pipes: bool = False
    ) -> asyncio.subprocess.Process:
        """Run a program.

        Args:
            name: name of the process.
            command: its command line.
            with_pipes: whether its standard input and output are pipes.
        """
        pipe = asyncio.subprocess.PIPE if with_pipes else asyncio.subprocess.DEVNULL
        with self._log(name).open("ab" if name in self._running else "wb") as log:
            process = await asyncio.create_subprocess_exec(
                *command,
                stdin=pipe,
                stdout=pipe,
                stderr=log,
                # Many processes share few cores: libraries must not start threads of their own.
                env=os.environ | dict.fromkeys(_THREAD_COUNTS, "1"),
            )
        self._running[name] = process
        self._ends[name] = asyncio.create_task(process.wait())
        return process

    async def kill(self, name: str) -> None:
        """End a process at once, as a power cut does; it may be started again."""
        end = self._ends.pop(name)
        self.send_signal(name, signal.SIGKILL)
        await end

    def send_signal(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a process, if it has not ended."""
        with contextlib.suppress(ProcessLookupError):
            self._running[name].send_signal(number)

    def pid(self, name: str) -> int:
        """Process ID of a process."""
        return self._running[name].pid

    async def sleep_until(self, at: float) -> None:
        """Sleep until the monotonic time `at`.

        Raises:
            ProcessError: a process has ended; the message has the last line of its log.
        """
        while True:
            timeout_s = min(max(0.0, at - time.monotonic()), _LOOK_INTERVAL_S)
            await asyncio.wait(
                self._ends.values(), timeout=timeout_s, return_when=asyncio.FIRST_COMPLETED
            )
            for name, end in self._ends.items():
                if end.done():
                    raise ProcessError(f"{name} ended unexpectedly: {self.last_log_line(name)}")
            if time.monotonic() >= at:
                return

    def last_log_line(self, name: str) -> str:
        """The last line of the log of a process."""
        lines = self._log(name).read_text(encoding="utf-8", errors="replace").splitlines()
        return lines[-1] if lines else "(empty log)"

    def _log(self, name: str) -> Path:
        return self._folder / f"{name}.log"

    async def __aenter__(self) -> "Processes":
        return self

    async def __aexit__(self, *_exception: object) -> None:
        await self.stop(*self._running)

    async def stop(self, *names: str) -> None:
        """Stop these processes: SIGTERM first, SIGKILL for those that do not end."""
        ends = [self._ends.pop(name) for name in names if name in self._ends]
        for name in names:
            process = self._running[name]
            if process.stdin is not None:
                process.stdin.close()
            if process.returncode is None:
                process.terminate()
        if not ends:
            return
        await asyncio.wait(ends, timeout=self._stopped_within_s)
        for name in names:
            if self._running[name].returncode is None:
                self._running[name].kill()
        await asyncio.gather(*ends)
