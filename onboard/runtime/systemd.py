"""Notifications to systemd: readiness, and a watchdog that is fed in each step of the daemon.

The protocol of sd_notify(3): datagrams with `NAME=value` lines to the socket in `NOTIFY_SOCKET`.
Without that variable nothing is sent.
"""

import contextlib
import socket
import time
from collections.abc import Mapping

FEEDS_PER_INTERVAL = 4
"""Notifications within one watchdog timeout."""


class Systemd:
    """The connection to systemd, if it started the process."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        """Read `NOTIFY_SOCKET` and `WATCHDOG_USEC`, which systemd sets."""
        address = environment.get("NOTIFY_SOCKET", "")
        # systemd writes the zero byte of an abstract address as @.
        self._address = "\0" + address[1:] if address.startswith("@") else address
        watchdog_s = float(environment.get("WATCHDOG_USEC", "inf")) / 1e6
        self._feed_every_s = watchdog_s / FEEDS_PER_INTERVAL
        self._feed_at = 0.0

    def ready(self, status: str) -> None:
        """Notify that all edges are open."""
        self._notify(f"READY=1\nSTATUS={status}")

    def reloading(self) -> None:
        """Notify that the configuration is reloaded; `ready` follows."""
        self._notify(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")

    def stopping(self) -> None:
        """Notify that the edges are being closed."""
        self._notify("STOPPING=1")

    def feed(self, now: float) -> None:
        """Feed the watchdog, if it is due, after a step at `now`."""
        if now >= self._feed_at:
            self._feed_at = now + self._feed_every_s
            self._notify("WATCHDOG=1")

    def _notify(self, text: str) -> None:
        if not self._address:
            return
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notifications:
            notifications.setblocking(False)  # the daemon never waits for systemd
            with contextlib.suppress(OSError):
                notifications.sendto(text.encode(), self._address)
