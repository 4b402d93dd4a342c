"""Opens the connection to the radio unit of the configuration."""

import asyncio
from collections.abc import Callable
from typing import Protocol

from onboard.wave_udp.iwcu import IwcuEndpoint
from onboard.wave_udp.raw import RawEndpoint
from onboard.wave_udp.rsu41 import Rsu41Endpoint
from onboard.wave_udp.settings import IwcuSettings, RadioSettings, Rsu41Settings


class Endpoint(Protocol):
    """A connection to a radio unit."""

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Pass on each received WSM, called from `loop`."""

    def send(self, wsm: bytes, user_priority: int) -> None:
        """Transmit `wsm` with a user priority of 0 to 7."""

    def close(self) -> None:
        """Close the connection."""


def open_endpoint(
    settings: RadioSettings,
    on_wsm: Callable[[bytes], None],
    on_error: Callable[[str], None] = lambda _why: None,
) -> Endpoint:
    """Open the connection.

    Args:
        settings: kind and address of the radio unit.
        on_wsm: called with everything received, malformed frames included.
        on_error: called with the reason each time the network reports that the radio cannot be
            reached: nothing listens, no such address, or the interface is down. A unit that accepts
            frames and transmits none is not detected.

    Raises:
        RadioError: it cannot be opened.
    """
    match settings:
        case IwcuSettings():
            return IwcuEndpoint(settings, on_wsm, on_error)
        case Rsu41Settings():
            return Rsu41Endpoint(settings, on_wsm, on_error)
        case _:
            return RawEndpoint(settings, on_wsm, on_error)
