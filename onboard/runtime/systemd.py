"""The wire to systemd: readiness, and a watchdog that is fed only while the car makes progress.

The protocol of sd_notify(3): datagrams with `NAME=value` lines to the socket that `NOTIFY_SOCKET`
names. Where nothing started us, everything here does nothing.
"""

import contextlib
import socket
import time
from collections.abc import Mapping

FEEDS_PER_INTERVAL = 4
"""How often the watchdog is fed in the time after which it bites."""


class Systemd:
    """systemd, as far as the environment says that it is there."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        """Read `NOTIFY_SOCKET` and `WATCHDOG_USEC`, which systemd sets."""
        address = environment.get("NOTIFY_SOCKET", "")
        # systemd writes the zero byte of an abstract address as @.
        self._address = "\0" + address[1:] if address.startswith("@") else address
        watchdog_s = float(environment.get("WATCHDOG_USEC", "inf")) / 1e6
        self._feed_every_s = watchdog_s / FEEDS_PER_INTERVAL
        self._feed_at = 0.0

    def ready(self, status: str) -> None:
        """All wires are open."""
        self._tell(f"READY=1\nSTATUS={status}")

    def reloading(self) -> None:
        """The configuration is read again; `ready` follows."""
        self._tell(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")

    def stopping(self) -> None:
        """The wires are being closed."""
        self._tell("STOPPING=1")

    def feed(self, now: float) -> None:
        """The cores have made a step at `now`."""
        if now >= self._feed_at:
            self._feed_at = now + self._feed_every_s
            self._tell("WATCHDOG=1")

    def _tell(self, text: str) -> None:
        if not self._address:
            return
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as wire:
            wire.setblocking(False)  # a car does not wait for who watches it
            with contextlib.suppress(OSError):
                wire.sendto(text.encode(), self._address)
