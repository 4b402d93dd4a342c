"""A datagram socket on an asyncio loop that keeps up: read until it is empty, in large gulps.

`loop.add_reader` with a loop of `recv`, since asyncio's own datagram transport costs several times
as much for each datagram and loses where this does not (docs/decisions/0043).
"""

import asyncio
import contextlib
import errno
import socket
from collections.abc import Callable, Sequence

from onboard.errors import UserError

RECEIVE_BUFFER_BYTES = 4 << 20
"""Asked of the kernel, which gives what net.core.rmem_max allows."""

LARGEST_DATAGRAM = 8192
"""A WSM is 2,302 bytes at most (802.11), twice that as hex text."""

_IP_RECVERR = 11
"""Of <linux/in.h>: have errors told that ICMP brings."""

_OF_ONE_DATAGRAM = (errno.ENOBUFS, errno.EMSGSIZE)
"""The interface's queue is full, or the datagram too long: the radio is there."""

GULP = 64
"""At most so many datagrams in one go, then the loop looks after the rest of the car."""


Address = tuple[str, int] | tuple[str, int, int, int, bytes]
"""Of UDP, or of the link layer."""
Option = tuple[int, int, bytes]
"""Ancillary data of one datagram: level, type, value."""


class RadioError(UserError):
    """The wire to the radio cannot be opened; one line for the user."""


class DrainedSocket:
    """Owns `wire`, a datagram socket that is bound already."""

    def __init__(
        self,
        wire: socket.socket,
        on_datagram: Callable[[bytes], None],
        on_trouble: Callable[[str], None],
    ) -> None:
        """`on_trouble` is told why something could not be sent, or did not arrive."""
        self.wire = wire
        self._on_datagram = on_datagram
        self._on_trouble = on_trouble
        self._loop: asyncio.AbstractEventLoop | None = None
        wire.setblocking(False)
        wire.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Call `on_datagram` from `loop` with each datagram that comes, until `close`."""
        self._loop = loop
        loop.add_reader(self.wire, self._drain)

    def send(self, data: bytes, address: Address, options: Sequence[Option] = ()) -> None:
        """Send `data`; it is lost where that cannot be, as on the air, and `on_trouble` is told."""
        try:
            self.wire.sendmsg((data,), options, 0, address)
        except BlockingIOError:
            pass  # more than the socket takes at a time
        except OSError as error:
            if error.errno not in _OF_ONE_DATAGRAM:
                self._tell(error)

    def close(self) -> None:
        """Leave the wire. No callback comes any more."""
        if self._loop is not None:
            self._loop.remove_reader(self.wire)
            self._loop = None
        self.wire.close()

    def _drain(self) -> None:
        receive, on_datagram = self.wire.recv, self._on_datagram
        for _ in range(GULP):
            try:
                datagram = receive(LARGEST_DATAGRAM)
            except BlockingIOError:
                return
            except OSError as error:  # of something sent earlier: no unit, or no interface
                self._tell(error)
                continue
            on_datagram(datagram)
            if self._loop is None:  # closed by who got the datagram
                return

    def _tell(self, error: OSError) -> None:
        # What ICMP said stands in a queue of its own as well, and wakes us until that is empty.
        with contextlib.suppress(OSError):
            while self.wire.recvmsg(0, 0, socket.MSG_ERRQUEUE):
                pass
        if self._loop is not None:
            self._on_trouble(error.strerror or repr(error))


def udp_socket(host: str, port: int) -> socket.socket:
    """Return a UDP socket bound to `host` and `port`.

    Raises:
        RadioError: it cannot be bound.
    """
    wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    wire.setsockopt(socket.IPPROTO_IP, _IP_RECVERR, 1)
    try:
        wire.bind((host, port))
    except OSError as error:
        wire.close()
        raise RadioError(f"radio: cannot listen on UDP {host}:{port}: {error.strerror}") from error
    return wire
