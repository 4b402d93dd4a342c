"""The daemon as a service: SIGHUP reloads its configuration, SIGINT and SIGTERM end it.

A new configuration takes effect as a whole: all edges are closed and opened again, and the vehicle
joins its warning group again. An invalid one, or one whose edges cannot be opened, is refused, and
the daemon continues with the previous one.
"""

import asyncio
import os
import signal
import time
from functools import partial
from pathlib import Path

import structlog

from onboard.errors import UserError
from onboard.runtime.daemon import Daemon
from onboard.runtime.systemd import Systemd
from onboard.settings import load_settings
from onboard.vehicle.config import CarConfig
from onboard.vision.camera_process import CameraWorker

log = structlog.get_logger()


class Service:
    """Runs one daemon after the other, each with its configuration."""

    def __init__(
        self, file: Path, config: CarConfig, camera_worker: CameraWorker | None = None
    ) -> None:
        """Start nothing yet.

        Args:
            file: has the configuration; it is read again when the service reloads.
            config: read from it.
            camera_worker: a process for its live camera, if one has been started.
        """
        self._file = file
        self._config = config
        self._camera_worker = camera_worker
        self._manager = Systemd(os.environ)
        self._signals: asyncio.Queue[signal.Signals] = asyncio.Queue()

    async def run(self) -> None:
        """Run until SIGINT or SIGTERM.

        Raises:
            UserError: an edge of the first configuration cannot be opened.
        """
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            loop.add_signal_handler(number, self._signals.put_nowait, number)
        proven: CarConfig | None = None
        daemon: Daemon | None = Daemon(self._config, self._manager, self._camera_worker)
        while daemon is not None:
            try:
                successor = await daemon.run(partial(self._until_signal, daemon))
            except UserError as error:
                if proven is None:
                    raise
                self._refuse(error)
                successor = Daemon(proven, self._manager)
                proven = None
            else:
                proven = daemon.config
            self._manager.feed(time.monotonic())  # to close what was open may have taken a second
            daemon = successor

    async def _until_signal(self, running: Daemon) -> Daemon | None:
        """Return the daemon of a valid new configuration; `None` on SIGINT or SIGTERM."""
        while await self._signals.get() is signal.SIGHUP:
            self._manager.reloading()
            running.save_driver()  # The next daemon reads it.
            try:
                config = load_settings(self._file, CarConfig)
                self._manager.feed(time.monotonic())
                successor = Daemon(config, self._manager)
            except UserError as error:
                self._refuse(error)
                self._manager.ready("configuration refused, continuing with the previous one")
            else:
                log.info("configuration reloaded", file=str(self._file))
                return successor
        self._manager.stopping()
        return None

    def _refuse(self, error: UserError) -> None:
        log.error("configuration refused", reason=str(error))
