"""Keeps whoever opens connections and says nothing from using up what the daemon may open.

Between the network and the web server: a connection on which nothing comes for a while is closed,
and of too many the first that has not said anything yet, be it the newest. A page asks at once
and confirms what it is shown: one that is alive is neither silent for so long nor thrown out.
"""

import asyncio
import math
from collections.abc import Callable

from typing_extensions import override

MOST_CONNECTIONS = 128
"""Each of the pages has a web socket, and a moment's worth of others while it is loaded."""
SILENT_S = 15.0

Factory = Callable[[], asyncio.Protocol]


class ConnectionLimiter:
    """Makes the protocols of one server."""

    def __init__(self, make_protocol: Factory) -> None:
        """`make_protocol` makes those of the server behind."""
        self._make_protocol = make_protocol
        self._guests: dict[_LimitedConnection, None] = {}
        """Those silent longest come first."""
        self._strangers: dict[_LimitedConnection, None] = {}
        """Those of them that have never said anything, oldest first."""
        self._timer: asyncio.TimerHandle | None = None

    def __call__(self) -> asyncio.Protocol:
        """Return the protocol of a new connection."""
        return _LimitedConnection(self._make_protocol(), self)

    def __len__(self) -> int:
        return len(self._guests)

    def close(self) -> None:
        """Look no more."""
        if self._timer is not None:
            self._timer.cancel()

    def welcome(self, guest: "_LimitedConnection") -> None:
        """Somebody has come."""
        self._guests[guest] = self._strangers[guest] = None
        if len(self._guests) > MOST_CONNECTIONS:
            self._dismiss(next(iter(self._strangers)))
        if self._timer is None:
            self._look()

    def hear(self, guest: "_LimitedConnection") -> None:
        """Something came from `guest`."""
        self._strangers.pop(guest, None)
        del self._guests[guest]
        self._guests[guest] = None

    def forget(self, guest: "_LimitedConnection") -> None:
        """The connection is closed."""
        self._guests.pop(guest, None)
        self._strangers.pop(guest, None)

    def _look(self) -> None:
        loop = asyncio.get_running_loop()
        long_ago = loop.time() - SILENT_S
        while self._guests and (first := next(iter(self._guests))).heard_at <= long_ago:
            self._dismiss(first)
        first_at = next(iter(self._guests)).heard_at if self._guests else math.inf
        self._timer = loop.call_at(first_at + SILENT_S, self._look) if self._guests else None

    def _dismiss(self, guest: "_LimitedConnection") -> None:
        self.forget(guest)
        guest.transport.abort()


class _LimitedConnection(asyncio.Protocol):
    """Hands everything on, and tells when something came."""

    transport: asyncio.Transport
    heard_at: float

    def __init__(self, server: asyncio.Protocol, keeper: ConnectionLimiter) -> None:
        self._server = server
        self._keeper = keeper
        self.pause_writing = server.pause_writing  # type: ignore[method-assign]
        self.resume_writing = server.resume_writing  # type: ignore[method-assign]
        self.eof_received = server.eof_received  # type: ignore[method-assign]

    @override
    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)  # noqa: S101 (of a TCP server)
        self.transport = transport
        self.heard_at = asyncio.get_running_loop().time()
        self._server.connection_made(transport)
        self._keeper.welcome(self)

    @override
    def data_received(self, data: bytes) -> None:
        self.heard_at = asyncio.get_running_loop().time()
        self._keeper.hear(self)
        self._server.data_received(data)

    @override
    def connection_lost(self, exc: Exception | None) -> None:
        self._keeper.forget(self)
        self._server.connection_lost(exc)
