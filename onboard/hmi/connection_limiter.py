"""Limits the TCP connections of the page server, so that idle ones do not exhaust file descriptors.

It sits between the network and the web server. A connection is closed whose client sends nothing
for `SILENT_S`, and takes nothing of what waits for it. Above `MOST_CONNECTIONS`, the oldest
connection without an accepted request is closed, which may be the newest. A page sends its request
at once and then confirms views, so it is never closed, and nobody without the token keeps it out.
"""

import asyncio
import math
from collections.abc import Callable

from typing_extensions import override

MOST_CONNECTIONS = 128
"""One web socket for each of 64 pages, and as many for pages that are being loaded."""
SILENT_S = 15.0
"""Longest time without data either way; a page confirms several views each second."""

Factory = Callable[[], asyncio.Protocol]


class ConnectionLimiter:
    """Creates the protocols of one server, and closes idle connections."""

    def __init__(self, make_protocol: Factory) -> None:
        """Forward to the protocols that `make_protocol` creates."""
        self._make_protocol = make_protocol
        self._connections: dict[_LimitedConnection, None] = {}
        """In the order of their last data."""
        self._not_accepted: dict[asyncio.BaseTransport, _LimitedConnection] = {}
        """Those of them whose requests were not accepted yet, oldest first."""
        self._timer: asyncio.TimerHandle | None = None

    def __call__(self) -> asyncio.Protocol:
        """Return the protocol of a new connection."""
        return _LimitedConnection(self._make_protocol(), self)

    def __len__(self) -> int:
        """Return the number of open connections."""
        return len(self._connections)

    def close(self) -> None:
        """Stop closing idle connections."""
        if self._timer is not None:
            self._timer.cancel()

    def add(self, connection: "_LimitedConnection") -> None:
        """Count a new connection; above the limit, close one without an accepted request."""
        self._connections[connection] = None
        self._not_accepted[connection.transport] = connection
        if len(self._connections) > MOST_CONNECTIONS:
            self._abort(next(iter(self._not_accepted.values())))
        if self._timer is None:
            self._close_silent()

    def accept(self, transport: asyncio.BaseTransport | None) -> None:
        """Keep the connection whose request was accepted."""
        if transport is not None:
            self._not_accepted.pop(transport, None)

    def note_data(self, connection: "_LimitedConnection") -> None:
        """Restart the time without data of a connection."""
        del self._connections[connection]
        self._connections[connection] = None

    def remove(self, connection: "_LimitedConnection") -> None:
        """Count a closed connection no more."""
        self._connections.pop(connection, None)
        self._not_accepted.pop(connection.transport, None)

    def _close_silent(self) -> None:
        loop = asyncio.get_running_loop()
        horizon = loop.time() - SILENT_S
        while self._connections and (first := next(iter(self._connections))).data_at <= horizon:
            self._abort(first)
        first_at = next(iter(self._connections)).data_at if self._connections else math.inf
        self._timer = (
            loop.call_at(first_at + SILENT_S, self._close_silent) if self._connections else None
        )

    def _abort(self, connection: "_LimitedConnection") -> None:
        self.remove(connection)
        connection.transport.abort()


class _LimitedConnection(asyncio.Protocol):
    """Forwards to the server's protocol, and reports data to the limiter."""

    transport: asyncio.Transport
    data_at: float
    """When the client last sent data, or took some that waited, on the loop's clock."""

    def __init__(self, server: asyncio.Protocol, limiter: ConnectionLimiter) -> None:
        self._server = server
        self._limiter = limiter
        self.pause_writing = server.pause_writing  # type: ignore[method-assign]
        self.eof_received = server.eof_received  # type: ignore[method-assign]

    @override
    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)  # noqa: S101 (of a TCP server)
        self.transport = transport
        self.data_at = asyncio.get_running_loop().time()
        self._server.connection_made(transport)
        self._limiter.add(self)

    @override
    def data_received(self, data: bytes) -> None:
        self._note_data()
        self._server.data_received(data)

    @override
    def resume_writing(self) -> None:
        self._note_data()
        self._server.resume_writing()

    def _note_data(self) -> None:
        self.data_at = asyncio.get_running_loop().time()
        self._limiter.note_data(self)

    @override
    def connection_lost(self, exc: Exception | None) -> None:
        self._limiter.remove(self)
        self._server.connection_lost(exc)
