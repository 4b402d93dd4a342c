"""A client of socketcand (a CAN bus over TCP) for an event loop.

python-can's own client cannot be used (measured with 4.6.1): it has no `fileno`, so a loop must
poll it; a connection closed by the server looks like silence and spins a core; a refused connection
is retried without a pause for 10 s. This one has the same protocol (rawmode,
https://github.com/linux-can/socketcand, doc/protocol.md) behind the same `can.BusABC`.
"""

import re
import select
import socket
from collections import deque
from collections.abc import Callable

import can
from typing_extensions import override

MAX_ELEMENT_CHARS = 256
"""Longest element of the protocol (an FD frame has 64 bytes); longer input is invalid."""

_RECEIVE_BYTES = 65536

_FRAME = re.compile(r"< frame ([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8}) (\d+\.\d+) ?((?:[0-9A-Fa-f]{2} ?)*)")
"""Some servers separate the data bytes by blanks."""


class ProtocolError(can.CanError):
    """Received text that is no element of the protocol."""


def parse_element(text: str) -> can.Message | None:
    """Parse `< ...`, one element without its closing `>`; `None` if it is no data frame.

    Identifiers of three digits are 11-bit ones, as the server writes them.

    Raises:
        ProtocolError: it is no element, or an invalid frame.
    """
    text = text.strip()
    if not text.startswith("<"):
        raise ProtocolError(f"no element: {text[:80]!r}")
    if not text.startswith("< frame"):
        return None
    match = _FRAME.fullmatch(text)
    if match is None:
        raise ProtocolError(f"no frame: {text[:80]!r}")
    identifier, stamp, data = match.groups()
    try:
        return can.Message(
            timestamp=float(stamp),
            arbitration_id=int(identifier, 16),
            is_extended_id=len(identifier) > 3,
            data=bytes.fromhex(data),
            check=True,
        )
    except ValueError as error:
        raise ProtocolError(f"no frame: {text[:80]!r}: {error}") from error


def format_send(message: can.Message) -> str:
    """The element that sends a classical data frame."""
    identifier = f"{message.arbitration_id:0{8 if message.is_extended_id else 3}X}"
    data = " ".join(f"{byte:02X}" for byte in message.data)
    return f"< send {identifier} {len(message.data)} {data} >"


class SocketcandBus(can.BusABC):
    """A connection in raw mode: it receives every frame of the bus, and nothing else."""

    def __init__(
        self, connection: socket.socket, channel: str, on_malformed: Callable[[str], None]
    ) -> None:
        """Take over a connection.

        Args:
            connection: of `connect`.
            channel: for messages.
            on_malformed: gets each element that is no frame; reading continues after it.
        """
        self.channel_info = channel
        self._socket = connection
        self._on_malformed = on_malformed
        self._text = ""
        self._messages: deque[can.Message] = deque()
        super().__init__(channel=channel)

    @override
    def fileno(self) -> int:
        return self._socket.fileno()

    @override
    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame, or raise `can.CanOperationError`; `timeout` is not used."""
        element = format_send(msg).encode("ascii")
        try:
            sent = self._socket.send(element)
        except OSError as error:
            raise can.CanOperationError(f"cannot send: {error.strerror}") from error
        if sent < len(element):
            # The rest of a partly sent element cannot be sent later; reading will find the end of
            # the connection.
            self._socket.shutdown(socket.SHUT_RDWR)
            raise can.CanOperationError("cannot send: the server does not read")

    @override
    def shutdown(self) -> None:
        super().shutdown()
        self._socket.close()

    @override
    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._messages:
            if timeout != 0 and not select.select([self._socket], [], [], timeout)[0]:
                return None, False
            self._receive()
        return (self._messages.popleft(), False) if self._messages else (None, False)

    def _receive(self) -> None:
        try:
            data = self._socket.recv(_RECEIVE_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            raise can.CanOperationError(f"connection lost: {error.strerror}") from error
        if not data:
            raise can.CanOperationError("the server closed the connection")
        *elements, self._text = (self._text + data.decode("ascii", "replace")).split(">")
        for element in elements:
            self._take(element)
        if len(self._text) > MAX_ELEMENT_CHARS:
            self._on_malformed(f"no end after {len(self._text)} characters")
            self._text = ""

    def _take(self, element: str) -> None:
        try:
            message = parse_element(element)
        except ProtocolError as error:
            self._on_malformed(str(error))
            return
        if message is not None:
            self._messages.append(message)


def connect(channel: str, host: str, port: int, timeout_s: float) -> socket.socket:
    """Connect, open `channel` and enter raw mode.

    Args:
        channel: of the server.
        host: of the server.
        port: of the server.
        timeout_s: of each step.

    Raises:
        OSError: the server cannot be reached, or does not answer in time.
        ProtocolError: it refuses, or is no socketcand.
    """
    connection = socket.create_connection((host, port), timeout=timeout_s)
    try:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # A server that vanished is an error for the reader too, after the same timeout; without a
        # request, the kernel asks for it.
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, round(timeout_s * 1000))
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 1)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 1)
        _expect(connection, "hi")
        for command in (f"open {channel}", "rawmode"):
            connection.sendall(f"< {command} >".encode("ascii"))
            _expect(connection, "ok")
        connection.setblocking(False)
    except BaseException:
        connection.close()
        raise
    return connection


def _expect(connection: socket.socket, answer: str) -> None:
    """Read one element and no byte more: frames may follow it at once."""
    received = b""
    while not received.endswith(b">"):
        byte = connection.recv(1)
        if not byte or len(received) > MAX_ELEMENT_CHARS:
            raise ProtocolError(f"not socketcand: expected < {answer} >, got {received[:80]!r}")
        received += byte
    text = received.decode("ascii", "replace").strip("<> ")
    if text != answer:
        raise ProtocolError(f"the server answered {text[:80]!r}")
