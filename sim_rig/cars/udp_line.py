"""What a device of a live run sends when it is due: to a port of 127.0.0.1, by UDP."""

import asyncio
import contextlib
import socket
import time
from typing import Protocol


class Device(Protocol):
    """A receiver or detector of the rig, without I/O."""

    def skip_to(self, now: float) -> None:
        """Say nothing of what was before `now`."""

    def get_timer(self) -> float:
        """When it next has something to say."""

    def bytes_to_send(self, now: float) -> bytes:
        """One datagram; empty while there is nothing to say."""


class UdpLine:
    """The line from a device into the car."""

    def __init__(self, device: Device, port: int) -> None:
        """Send from now on; `close` ends it. The loop is the running one."""
        self._device = device
        self._line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._line.setblocking(False)
        self._line.connect(("127.0.0.1", port))
        device.skip_to(time.monotonic())
        self._arm()

    def close(self) -> None:
        """Switch the device off."""
        self._timer.cancel()
        self._line.close()

    def _arm(self) -> None:
        loop = asyncio.get_running_loop()
        self._timer = loop.call_at(self._device.get_timer(), self._send)

    def _send(self) -> None:
        now = time.monotonic()
        while self._device.get_timer() <= now:
            if data := self._device.bytes_to_send(now):
                # Who is not up yet hears nothing.
                with contextlib.suppress(ConnectionRefusedError, BlockingIOError):
                    self._line.send(data)
        self._arm()
