"""The car as a service: driven until it is told to stop, its configuration read again on SIGHUP.

A new configuration takes effect as a whole: all wires are closed and opened again, and the groups
that the car was in are found again. One that is wrong, or whose wires cannot be opened, is refused
and the car goes on with the one before.
"""

import asyncio
import os
import signal
from functools import partial
from pathlib import Path

import structlog

from onboard.config import CarConfig
from onboard.daemon import Daemon
from onboard.errors import UserError
from onboard.runtime.systemd import Systemd
from onboard.settings import load_settings

log = structlog.get_logger()


class Service:
    """Who drives, and with which configuration."""

    def __init__(self, file: Path) -> None:
        """Take the configuration's file, which `run` reads."""
        self._file = file
        self._manager = Systemd(os.environ)
        self._asked: asyncio.Queue[signal.Signals] = asyncio.Queue()

    async def run(self) -> None:
        """Drive until SIGINT or SIGTERM.

        Raises:
            UserError: the first configuration is wrong, or one of its wires cannot be opened.
        """
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            loop.add_signal_handler(number, self._asked.put_nowait, number)
        config = self._read()
        proven: CarConfig | None = None
        daemon: Daemon | None = Daemon(config, self._manager)
        while daemon is not None:
            try:
                following = await daemon.run(partial(self._until_asked, daemon))
            except UserError as error:
                if proven is None:
                    raise
                self._refuse(error)
                following = Daemon(proven, self._manager)
                proven = None
            else:
                proven = daemon.config
            daemon = following

    async def _until_asked(self, driving: Daemon) -> Daemon | None:
        """Wait for a configuration that can be driven with, or for the end (`None`)."""
        while await self._asked.get() is signal.SIGHUP:
            self._manager.reloading()
            driving.save_driver()  # for the one that follows to read
            try:
                following = Daemon(self._read(), self._manager)
            except UserError as error:
                self._refuse(error)
                self._manager.ready("configuration refused, driving with the one before")
            else:
                log.info("configuration read again", file=str(self._file))
                return following
        self._manager.stopping()
        return None

    def _read(self) -> CarConfig:
        return load_settings(self._file, CarConfig)

    def _refuse(self, error: UserError) -> None:
        log.error("configuration refused", reason=str(error))
