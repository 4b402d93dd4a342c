"""The edge: a TCP server on 127.0.0.1 whose clients get events, and send requests, line by line."""

import asyncio
import contextlib
from collections.abc import Callable

import structlog

from onboard.errors import DecodeError, UserError
from onboard.interface.event_stream import EventReader, EventStream, line_of
from onboard.interface.requests import (
    BrakeButtonPress,
    MessageRequest,
    ObjectList,
    Request,
    Subscribe,
    read_request,
)
from onboard.interface.settings import InterfaceSettings

log = structlog.get_logger()

VERSION = 1
"""Of the lines, in the first one that each client gets; raised when a client must change."""
HOST = "127.0.0.1"
MOST_CLIENTS = 32
MOST_LINE_BYTES = 1 << 16
MESSAGE_INTERVAL_S = 0.02
"""Least time between two messages that programs have sent: each is signed in the loop."""
_SENT_BYTES = 1 << 16
"""That wait in a socket before its client counts as slow."""


class EventServer:
    """Serves the interface of one vehicle."""

    def __init__(
        self,
        settings: InterfaceSettings,
        build: str,
        on_brake: Callable[[], None],
        on_object_list: Callable[[bytes], None],
        on_message: Callable[[MessageRequest], None],
    ) -> None:
        """Build the server; nothing is served yet.

        Args:
            settings: port, and what clients may send.
            build: of the daemon, for the first line.
            on_brake: called when a client presses the brake button.
            on_object_list: called with a detector's list.
            on_message: called with a message to send.
        """
        self._settings = settings
        self._sends = frozenset(each.psid for each in settings.sends)
        self._build = build
        self._on_brake = on_brake
        self._on_object_list = on_object_list
        self._on_message = on_message
        self._stream = EventStream()
        self._clients: set[asyncio.Task[None]] = set()
        self._sending = asyncio.Lock()
        self._detector: EventReader | None = None
        """The client that sends a detector's lists; two would make each vehicle leap."""
        self.wants = self._stream.wants
        self.publish = self._stream.publish

    async def start(self) -> None:
        """Listen.

        Raises:
            UserError: the port cannot be opened.
        """
        port = self._settings.port
        try:
            self._server = await asyncio.start_server(
                self._serve, HOST, port, limit=MOST_LINE_BYTES
            )
        except OSError as error:
            raise UserError(f"interface: {HOST}:{port}: {error.strerror}") from error
        log.info("interface", address=f"{HOST}:{port}")

    async def close(self) -> None:
        """Disconnect all clients and stop listening."""
        self._server.close()
        for client in self._clients:
            client.cancel()
        await asyncio.gather(*self._clients, return_exceptions=True)

    async def _serve(self, lines: asyncio.StreamReader, client: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None  # noqa: S101 (called in one)
        if len(self._clients) >= MOST_CLIENTS:
            client.close()
            return
        self._clients.add(task)
        client.transport.set_write_buffer_limits(_SENT_BYTES)
        reader = self._stream.open()
        first = {"kind": "interface", "version": VERSION, "build": self._build}
        client.write(line_of(first))
        sending = asyncio.create_task(_send(reader, client))
        try:
            await self._take_requests(lines, client, reader)
        except asyncio.CancelledError:
            pass
        finally:
            sending.cancel()
            self._stream.close(reader)
            self._detector = None if self._detector is reader else self._detector
            self._clients.discard(task)
            client.transport.abort()  # what a client does not read would keep its socket

    async def _take_requests(
        self, lines: asyncio.StreamReader, client: asyncio.StreamWriter, reader: EventReader
    ) -> None:
        """Take a client's lines until it sends no more: then it is gone, or will be.

        The first line that is refused ends it: what a web page posts to this port has HTTP's lines
        before its own.
        """
        while True:
            try:
                await asyncio.sleep(0)  # lines that have arrived together are no single step
                line = await lines.readline()
            except (ValueError, ConnectionError):  # longer than the limit; gone
                return
            if not line:
                return
            try:
                request = self._read(line, reader)
            except DecodeError as error:
                client.write(
                    line_of({"kind": "refused", "reason": error.reason, "detail": error.detail})
                )
                return
            match request:
                case Subscribe():
                    reader.subscribe(request.kinds)
                case BrakeButtonPress():
                    self._on_brake()
                case ObjectList():
                    self._on_object_list(line)
                case MessageRequest():
                    async with self._sending:  # of all clients; their lines wait in sockets
                        self._on_message(request)
                        await asyncio.sleep(MESSAGE_INTERVAL_S)

    def _read(self, line: bytes, reader: EventReader) -> Request:
        """Read a client's line. Raises `DecodeError`, also of a second client that sends lists."""
        request = read_request(line, self._settings.accepts, self._sends)
        if isinstance(request, ObjectList):
            self._detector = self._detector or reader
            if self._detector is not reader:
                raise DecodeError("in_use", "another program sends object_list")
        return request


async def _send(reader: EventReader, client: asyncio.StreamWriter) -> None:
    with contextlib.suppress(ConnectionError):
        while True:
            client.write(await reader.next())
            await client.drain()
