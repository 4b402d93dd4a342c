"""A datagram socket on an asyncio loop that is read until it is empty.

It uses `loop.add_reader` with a loop of `recv`: asyncio's datagram transport costs several times as
much per datagram and loses some under load (docs/design/wave_udp.md, "Receiving").
"""

import asyncio
import contextlib
import errno
import socket
from collections.abc import Callable, Sequence

from onboard.errors import UserError

RECEIVE_BUFFER_BYTES = 4 << 20
"""Requested of the kernel, which grants up to net.core.rmem_max."""

MAX_DATAGRAM_BYTES = 8192
"""A WSM is 2,302 bytes at most (802.11), twice that as hex text."""

_IP_RECVERR = 11
"""IP_RECVERR of <linux/in.h>: report errors that arrive by ICMP."""

_DATAGRAM_ERRORS = (errno.ENOBUFS, errno.EMSGSIZE)
"""A full queue of the interface, or a datagram too long: the radio is reachable."""

MAX_DATAGRAMS_PER_READ = 64
"""Datagrams read in one callback, so that other work of the loop gets its turn."""


Address = tuple[str, int] | tuple[str, int, int, int, bytes]
"""A UDP or link-layer address."""
Option = tuple[int, int, bytes]
"""Ancillary data of a datagram: level, type, value."""


class RadioError(UserError):
    """The connection to the radio cannot be opened; one line for the user."""


class DrainedSocket:
    """Reads and writes a datagram socket."""

    def __init__(
        self,
        wire: socket.socket,
        on_datagram: Callable[[bytes], None],
        on_error: Callable[[str], None],
        *,
        from_host: str | None = None,
    ) -> None:
        """Take ownership of a socket.

        Args:
            wire: a bound datagram socket.
            on_datagram: called with each datagram.
            on_error: called with the reason when the radio cannot be reached.
            from_host: address of the only host whose datagrams are taken, if there is one.
        """
        self._from_host = from_host
        self.wire = wire
        self._on_datagram = on_datagram
        self._on_error = on_error
        self._loop: asyncio.AbstractEventLoop | None = None
        wire.setblocking(False)
        wire.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Call `on_datagram` from `loop` with each datagram, until `close`."""
        self._loop = loop
        loop.add_reader(self.wire, self._drain)

    def send(self, data: bytes, address: Address, options: Sequence[Option] = ()) -> None:
        """Send a datagram. One that cannot be sent is dropped, and `on_error` called.

        Args:
            data: the datagram.
            address: where to.
            options: ancillary data.
        """
        try:
            self.wire.sendmsg((data,), options, 0, address)
        except BlockingIOError:
            pass  # the send buffer is full
        except OSError as error:
            if error.errno not in _DATAGRAM_ERRORS:
                self._report(error)

    def close(self) -> None:
        """Close the socket. No callback follows."""
        if self._loop is not None:
            self._loop.remove_reader(self.wire)
            self._loop = None
        self.wire.close()

    def _drain(self) -> None:
        receive, on_datagram = self.wire.recvfrom, self._on_datagram
        for _ in range(MAX_DATAGRAMS_PER_READ):
            try:
                datagram, sender = receive(MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                return
            except OSError as error:  # about an earlier datagram: no unit, or no interface
                self._report(error)
                continue
            if self._from_host in (None, sender[0]):
                on_datagram(datagram)
            if self._loop is None:  # closed by the callback
                return

    def _report(self, error: OSError) -> None:
        # ICMP errors are queued apart as well, and wake the loop until that queue is empty.
        with contextlib.suppress(OSError):
            while self.wire.recvmsg(0, 0, socket.MSG_ERRQUEUE):
                pass
        if self._loop is not None:
            self._on_error(error.strerror or repr(error))


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
