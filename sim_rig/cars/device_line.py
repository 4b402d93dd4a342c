"""Sends the output of a simulated device when it is due: by UDP, or on a serial line.

What nobody receives is lost.
"""

import asyncio
import contextlib
import os
import socket
import time
from collections.abc import Callable
from ipaddress import IPv4Address
from pathlib import Path
from typing import Protocol

from onboard.errors import UserError


class Device(Protocol):
    """A GNSS receiver or vehicle detector of the rig, without I/O."""

    def skip_to(self, now: float) -> None:
        """Skip measurements before `now`."""

    def get_timer(self) -> float:
        """Return when the next datagram is due."""

    def bytes_to_send(self, now: float) -> bytes:
        """Return one datagram; empty if none is due."""


class UdpLine:
    """Datagrams to one address."""

    def __init__(self, host: IPv4Address, port: int) -> None:
        """Open a socket."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._address = str(host), port

    def send(self, data: bytes) -> None:
        """Send one datagram."""
        with contextlib.suppress(OSError):
            self._socket.sendto(data, self._address)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class SerialLine:
    """A serial line or pty, with the speed that it has."""

    def __init__(self, path: Path) -> None:
        """Open it.

        Raises:
            UserError: it cannot be opened.
        """
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            raise UserError(f"{path}: cannot be opened: {error.strerror}") from error

    def send(self, data: bytes) -> None:
        """Write as much as the line takes."""
        with contextlib.suppress(OSError):
            os.write(self._file, data)

    def close(self) -> None:
        """Close the line."""
        os.close(self._file)


class DeviceLine:
    """A device at work."""

    def __init__(
        self,
        device: Device,
        line: UdpLine | SerialLine,
        on_late: Callable[[float], None] = lambda _late_s: None,
    ) -> None:
        """Send from now on, until `close`, on the running event loop.

        Args:
            device: the device.
            line: its wire, closed with it.
            on_late: called with the lateness of each datagram, s.
        """
        self._device = device
        self._line = line
        self._on_late = on_late
        device.skip_to(time.monotonic())
        self._arm()

    def close(self) -> None:
        """Stop sending."""
        self._timer.cancel()
        self._line.close()

    def _arm(self) -> None:
        loop = asyncio.get_running_loop()
        self._timer = loop.call_at(self._device.get_timer(), self._send)

    def _send(self) -> None:
        now = time.monotonic()
        while (at := self._device.get_timer()) <= now:
            if data := self._device.bytes_to_send(now):
                self._line.send(data)
                self._on_late(now - at)
        self._arm()
