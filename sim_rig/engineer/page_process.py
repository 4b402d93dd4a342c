"""Starts the process of the engineer's page, and sends it the rig's own records."""

import asyncio
import json
from collections.abc import Mapping
from pathlib import Path

from sim_rig.processes.processes import ProcessError, Processes
from sim_rig.run_log.rig_recorder import RigRecorder

ENGINEER = "engineer"
"""Name of the page and of its process."""
_SEND_INTERVAL_S = 0.25
_SENT_KIND = "ecu_answer"
"""The only kind of rig record that the latency ledger needs."""


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

        Args:
            processes: where it becomes a child process.
            scenario_file: the scenario as JSON.
            folder: folder of the traces.
            camera_port: port of the camera server.

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
            reason = processes.last_log_line(ENGINEER)
            raise ProcessError(f"the engineer's page does not start: {reason}")
        return cls(process, f"http://127.0.0.1:{int(line)}/")

    def link(self, pages: Mapping[str, str]) -> None:
        """Send the addresses of the drivers' pages."""
        self._send({"kind": "pages", "pages": dict(pages)})

    def begin(self, start_s: float) -> None:
        """Send the start time of the scenario."""
        self._send({"kind": "start", "stamp_s": start_s})

    async def follow(self, recorder: RigRecorder) -> None:
        """Send new records of the rig until cancelled."""
        sent = 0
        while True:
            records = recorder.records[sent:]
            sent += len(records)
            for record in records:
                if record["kind"] == _SENT_KIND:
                    self._send(record)
            await asyncio.sleep(_SEND_INTERVAL_S)

    def _send(self, record: dict[str, object]) -> None:
        assert self._process.stdin is not None  # noqa: S101 (started with pipes)
        self._process.stdin.write(json.dumps(record).encode() + b"\n")
