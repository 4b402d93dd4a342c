"""Opens the wire to the radio that the configuration names."""

import asyncio
from collections.abc import Callable
from typing import Protocol

from onboard.wave_udp.iwcu import IwcuEndpoint
from onboard.wave_udp.raw import RawEndpoint
from onboard.wave_udp.rsu41 import Rsu41Endpoint
from onboard.wave_udp.settings import IwcuSettings, RadioSettings, Rsu41Settings


class Endpoint(Protocol):
    """A wire to a radio."""

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Hand over each WSM that the radio receives, called from `loop`."""

    def send(self, wsm: bytes, user_priority: int) -> None:
        """Have the radio send `wsm`, user priority 0 to 7."""

    def close(self) -> None:
        """Leave the wire."""


def open_endpoint(
    settings: RadioSettings,
    on_wsm: Callable[[bytes], None],
    on_trouble: Callable[[str], None] = lambda _why: None,
) -> Endpoint:
    """Open the wire.

    Args:
        settings: which.
        on_wsm: gets what the radio hands over, garbage included.
        on_trouble: told why the radio cannot be reached, as often as that is noticed. Only what
            the network says is: that nothing listens there, nobody has the address, or the
            interface is down. A unit that takes everything and sends nothing is not noticed.

    Raises:
        RadioError: it cannot be opened.
    """
    match settings:
        case IwcuSettings():
            return IwcuEndpoint(settings, on_wsm, on_trouble)
        case Rsu41Settings():
            return Rsu41Endpoint(settings, on_wsm, on_trouble)
        case _:
            return RawEndpoint(settings, on_wsm, on_trouble)
