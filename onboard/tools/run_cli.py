"""`onboard run`: the daemon."""

import asyncio
import faulthandler
import logging
import os
import sys
from collections.abc import Mapping, MutableMapping
from pathlib import Path
from typing import Annotated

import structlog
import typer

from onboard.runtime.polled_loop import PolledLoop
from onboard.settings import load_settings
from onboard.tools.commands import without_collection
from onboard.vehicle.config import CarConfig
from onboard.vision.camera_process import CameraWorker

PRIORITIES = {"critical": 2, "error": 3, "warning": 4, "info": 6, "debug": 7}
"""Severities of syslog (RFC 5424, table 2), by structlog's names."""


def flat(_logger: object, _method: str, line: MutableMapping[str, object]) -> dict[str, object]:
    """Put the fields of an event beside its name, as text, but those that the line has anyway."""
    details = line.pop("details", {})
    facts = dict(details) if isinstance(details, Mapping) else {"details": details}
    return {
        **line,
        **{key: str(value) for key, value in facts.items() if key not in ("stamp_s", "kind")},
    }


_FOR_PROGRAMS = (
    structlog.processors.TimeStamper(fmt="iso", utc=True),
    structlog.processors.JSONRenderer(),
)
_FOR_READERS = (
    structlog.processors.TimeStamper(fmt="%H:%M:%S", utc=False),
    flat,
    structlog.dev.ConsoleRenderer(),
)


def run(
    file: Annotated[
        Path, typer.Argument(metavar="CONFIG", help="The car's configuration, a YAML file.")
    ],
) -> None:
    """Run the daemon until it is stopped. SIGHUP reloads its configuration."""
    faulthandler.enable()  # A watchdog's SIGABRT then logs where it hung.
    _configure_log()
    config = load_settings(file, CarConfig)
    has_live_camera = config.camera is not None and config.camera.is_live
    worker = CameraWorker() if has_live_camera else None
    with without_collection():
        # For a second or two, in which the camera's process imports as well.
        from onboard.runtime.service import Service  # noqa: PLC0415

    with asyncio.Runner(loop_factory=PolledLoop) as runner:
        runner.run(Service(file, config, worker).run())


def _configure_log() -> None:
    in_journal = "JOURNAL_STREAM" in os.environ
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            *(_FOR_READERS if sys.stderr.isatty() else _FOR_PROGRAMS),
            *([_with_priority] if in_journal else []),
        ],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        logger_factory=structlog.PrintLoggerFactory(sys.stderr),
    )


def _with_priority(_logger: object, method: str, line: object) -> str:
    """Add the priority that `journalctl -p` reads to a log line (sd-daemon(3))."""
    priority = PRIORITIES.get(method, PRIORITIES["info"])
    return f"<{priority}>{line}"
