"""A daemon that notes when a warning passes each stage.

    python -m bench._traced_daemon [--no-camera] CONFIG OUT

The functions with which stages begin or end are wrapped here; the daemon's own code is unchanged.
`OUT` gets one JSON object for each warning. With `--no-camera`, a thread that only sleeps reports
the lead in place of the camera's process.
"""

import argparse
import asyncio
import json
import threading
import time
import zlib
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

from onboard.lcca.group import WarningGroup
from onboard.messages import lcca
from onboard.observations import Lead, LeadIdentity, PlateCandidate
from onboard.runtime import wires
from onboard.runtime.daemon import Daemon
from onboard.runtime.output_sinks import OutputSinks
from onboard.runtime.service import Service
from onboard.security.security_services import SecurityServices
from onboard.settings import load_settings
from onboard.vehicle.config import CarConfig
from onboard.vision.seen import Seen
from onboard.wave_udp.iwcu import IwcuEndpoint

LEAD_PLATE = "AB123CD"
GAP_M = 15.0
FRAME_S = 1.0 / 15.0

_passed: dict[str, float] = {}
"""When each stage was last passed, in s, and the checksum of the last frame."""
_rows: list[dict[str, float]] = []


def main() -> None:
    """Run the daemon until SIGTERM, then write what was noted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--no-camera", action="store_true")
    parser.add_argument("config", type=Path)
    parser.add_argument("out", type=Path)
    given = parser.parse_args()
    _note(Daemon, "_take_wsm", before="taken", checksum=True)
    _note(SecurityServices, "open", before="begun", after="verified")
    _note(lcca, "decode", after="decoded")
    _note(WarningGroup, "receive_message", after="grouped")
    _note(SecurityServices, "secure", after="signed")
    _note(IwcuEndpoint, "send", after="sent")
    _note_shown()
    if given.no_camera:
        wires.CameraProcess = _NoCamera  # type: ignore[attr-defined, assignment]
    asyncio.run(Service(given.config, load_settings(given.config, CarConfig)).run())
    given.out.write_text("".join(json.dumps(row) + "\n" for row in _rows), encoding="utf-8")


def _note(
    owner: Any, name: str, *, before: str = "", after: str = "", checksum: bool = False
) -> None:
    """Have calls of a function noted when they begin, end or both."""
    function: Callable[..., Any] = getattr(owner, name)

    @wraps(function)
    def noting(*args: Any, **named: Any) -> Any:
        if before:
            _passed[before] = time.monotonic()
        if checksum:
            _passed["checksum"] = zlib.crc32(args[-1])
        result = function(*args, **named)
        if after:
            _passed[after] = time.monotonic()
        return result

    setattr(owner, name, noting)


def _note_shown() -> None:
    show_step = OutputSinks.show_step

    def noting(sinks: OutputSinks, events: Any, now: float) -> None:
        show_step(sinks, events, now)
        _rows.extend(
            _passed | {"shown": time.monotonic()} for event in events if event.kind == "warning"
        )

    OutputSinks.show_step = noting  # type: ignore[method-assign, assignment]


class _NoCamera:
    """Reports the same lead at the rate of a camera."""

    def __init__(
        self, _work: object, on_seen: Callable[[Seen], None], _worker: object = None
    ) -> None:
        self._on_seen = on_seen
        self._closed = threading.Event()

    def receive_curvature(self, curvature: object) -> None:
        pass

    def spawn(self) -> None:
        pass

    def start(self) -> None:
        threading.Thread(target=self._run, daemon=True).start()

    def close(self) -> None:
        self._closed.set()

    def _run(self) -> None:
        candidates = (PlateCandidate(LEAD_PLATE, 0.98),)
        while not self._closed.wait(FRAME_S):
            known = (LeadIdentity.KNOWN, LEAD_PLATE, GAP_M, 0.3, 0.0, 0.3)
            self._on_seen(Seen((Lead(time.monotonic(), *known, 1, candidates),)))


if __name__ == "__main__":
    main()
