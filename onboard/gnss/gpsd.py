"""The wire to gpsd: a TCP connection, which is reopened after a loss."""

import asyncio
import os
import socket
from collections.abc import Callable

from typing_extensions import override

from onboard.gnss.gpsd_reader import WATCH
from onboard.gnss.settings import GnssSettings

RECONNECT_PERIOD_S = 1.0
KEEP_ALIVE = (
    (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
    (socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 1),
    (socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 1),
    (socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3),
)
"""Options of a connection that is lost 4 s after the other computer has fallen silent: who only
listens would wait for it for ever."""


class Gpsd:
    """Delivers gpsd's data; a missing gpsd is a state and no error, since GNSS is optional."""

    def __init__(
        self,
        settings: GnssSettings,
        on_data: Callable[[bytes], None],
        on_state: Callable[[bool, str], None],
    ) -> None:
        """Take the callbacks; both are called from the loop.

        Args:
            settings: address of gpsd.
            on_data: gets received bytes.
            on_state: gets whether gpsd is connected, and the reason if not, on each change.
        """
        self._settings = settings
        self._on_data = on_data
        self._on_state = on_state
        self._task: asyncio.Task[None] | None = None

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Start connecting, repeatedly; returns at once."""
        self._task = loop.create_task(self._run(loop))

    def close(self) -> None:
        """Close the connection. No callback is called afterwards."""
        if self._task is not None:
            self._task.cancel()

    async def _run(self, loop: asyncio.AbstractEventLoop) -> None:
        reported: str | None = None
        while True:
            try:
                transport, watcher = await loop.create_connection(
                    lambda: _Watcher(self._on_data, loop.create_future()),
                    self._settings.host,
                    self._settings.port,
                )
            except OSError as error:
                why = f"gpsd at {self._settings.host}:{self._settings.port}: {_cause(error)}"
            else:
                self._on_state(True, "")
                reported = None
                try:
                    await watcher.lost
                finally:
                    transport.abort()
                why = "gpsd closed the connection"
            if why != reported:
                self._on_state(False, why)
                reported = why
            await asyncio.sleep(RECONNECT_PERIOD_S)


def _cause(error: OSError) -> str:
    """The system's message; asyncio's own repeats the address."""
    return os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)


class _Watcher(asyncio.Protocol):
    """One connection."""

    def __init__(self, on_data: Callable[[bytes], None], lost: asyncio.Future[None]) -> None:
        self._on_data = on_data
        self.lost = lost

    @override
    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.WriteTransport)  # noqa: S101 (TCP is)
        for option in KEEP_ALIVE:
            transport.get_extra_info("socket").setsockopt(*option)
        transport.write(WATCH)

    @override
    def data_received(self, data: bytes) -> None:
        if not self.lost.done():
            self._on_data(data)

    @override
    def connection_lost(self, exc: Exception | None) -> None:
        if not self.lost.done():
            self.lost.set_result(None)
