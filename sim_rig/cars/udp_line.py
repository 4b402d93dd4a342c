"""Sends the output of a simulated device by UDP to 127.0.0.1 when it is due."""

import asyncio
import contextlib
import socket
import time
from typing import Protocol


class Device(Protocol):
    """A GNSS receiver or vehicle detector of the rig, without I/O."""

    def skip_to(self, now: float) -> None:
        """Skip measurements before `now`."""

    def get_timer(self) -> float:
        """Return when the next datagram is due."""

    def bytes_to_send(self, now: float) -> bytes:
        """Return one datagram; empty if none is due."""


class UdpLine:
    """The connection from a device to the daemon."""

    def __init__(self, device: Device, port: int) -> None:
        """Send from now on, until `close`, on the running event loop."""
        self._device = device
        self._line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._line.setblocking(False)
        self._line.connect(("127.0.0.1", port))
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
        while self._device.get_timer() <= now:
            if data := self._device.bytes_to_send(now):
                # A daemon that does not listen yet loses the datagram.
                with contextlib.suppress(ConnectionRefusedError, BlockingIOError):
                    self._line.send(data)
        self._arm()
