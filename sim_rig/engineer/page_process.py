"""The rig's end of the engineer's page: starts its process, tells it what only the rig knows."""

import asyncio
import json
from collections.abc import Mapping
from pathlib import Path

from sim_rig.processes.processes import ProcessError, Processes
from sim_rig.run_log.rig_recorder import RigRecorder

ENGINEER = "engineer"
"""Whose page it is, and its process."""
_TELL_S = 0.25
_TOLD = "ecu_answer"
"""All that the ledger wants of the rig's own records."""


class EngineerPage:
    """The engineer's page of one run."""

    def __init__(self, process: asyncio.subprocess.Process, address: str) -> None:
        self.address = address
        self._process = process

    @classmethod
    async def open(
        cls, processes: Processes, scenario_file: Path, folder: Path, camera_port: int
    ) -> "EngineerPage":
        """Start the process.

        Raises:
            ProcessError: it does not start.
        """
        process = await processes.start(
            ENGINEER,
            *("-m", "sim_rig.engineer.server", str(scenario_file), str(folder), str(camera_port)),
            with_pipes=True,
        )
        assert process.stdout is not None  # noqa: S101 (started with pipes)
        line = await process.stdout.readline()
        if not line:
            raise ProcessError(f"the page does not start: {processes.last_words(ENGINEER)}")
        return cls(process, f"http://127.0.0.1:{int(line)}/")

    def link(self, pages: Mapping[str, str]) -> None:
        """Where the drivers' pages are."""
        self._tell({"kind": "pages", "pages": dict(pages)})

    def begin(self, start_s: float) -> None:
        """The scenario begins."""
        self._tell({"kind": "start", "stamp_s": start_s})

    async def follow(self, recorder: RigRecorder) -> None:
        """Tell what the rig notes, as long as it runs."""
        told = 0
        while True:
            records = recorder.records[told:]
            told += len(records)
            for record in records:
                if record["kind"] == _TOLD:
                    self._tell(record)
            await asyncio.sleep(_TELL_S)

    def _tell(self, record: dict[str, object]) -> None:
        assert self._process.stdin is not None  # noqa: S101 (started with pipes)
        self._process.stdin.write(json.dumps(record).encode() + b"\n")
