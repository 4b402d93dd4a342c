"""Daemons that are forked from a process which has imported what they need.

`python -m onboard run` imports for two seconds before it does anything; so it is started in
`tests/runtime/test_failing_disk.py`, and elsewhere nothing of it but its end.
"""

import multiprocessing
import os
import resource
import signal
import sys
from collections.abc import Mapping
from pathlib import Path

from onboard.tools.cli import main
from tests.recorder.waiting import WITHIN_S

_FORKS = multiprocessing.get_context("forkserver")
_FORKS.set_forkserver_preload(["onboard.runtime.service", "onboard.tools.run_cli", __name__])


class ForkedDaemon:
    """`onboard run` with a configuration; its log is a file beside that."""

    def __init__(
        self,
        config: Path,
        environment: Mapping[str, str] | None = None,
        most_file_bytes: int | None = None,
    ) -> None:
        """Start it, with more variables in its environment and a limit of files' sizes."""
        self._log = config.with_suffix(".log")
        arguments = (config, self._log, environment or {}, most_file_bytes)
        self._process = _FORKS.Process(target=_run, args=arguments)
        self._process.start()

    @property
    def log(self) -> str:
        """What it has logged."""
        return self._log.read_text("utf-8") if self._log.exists() else ""

    @property
    def returncode(self) -> int | None:
        """Of its end; `None` while it runs."""
        return self._process.exitcode

    def send_signal(self, number: signal.Signals) -> None:
        assert self._process.pid is not None
        os.kill(self._process.pid, number)

    def wait(self) -> int:
        """Wait for its end, and return `returncode`."""
        self._process.join(WITHIN_S)
        assert self.returncode is not None
        return self.returncode

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        self.send_signal(number)
        return self.wait()

    def release(self) -> None:
        """Kill it, if it still runs."""
        self._process.kill()
        self._process.join()


def _run(
    config: Path, log: Path, environment: Mapping[str, str], most_file_bytes: int | None
) -> None:
    with log.open("ab") as file:
        os.dup2(file.fileno(), sys.stderr.fileno())
    os.environ.update(environment)
    if most_file_bytes is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most_file_bytes, most_file_bytes))
    sys.argv = ["onboard", "run", str(config)]
    main()
