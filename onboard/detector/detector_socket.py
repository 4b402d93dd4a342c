"""The UDP socket that receives the detector's datagrams."""

import asyncio
from collections.abc import Callable

from typing_extensions import override

from onboard.detector.settings import DetectorSettings
from onboard.errors import UserError


class DetectorError(UserError):
    """The port cannot be opened; one line for the user."""


async def open_detector(
    settings: DetectorSettings, on_data: Callable[[bytes], None]
) -> asyncio.DatagramTransport:
    """Call `on_data` with each datagram, in the running loop, until the transport is closed.

    Raises:
        DetectorError: the port cannot be opened.
    """
    address = settings.host, settings.port
    try:
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: _Listener(on_data), local_addr=address
        )
    except OSError as error:
        why = f"detector: cannot listen at {address[0]}:{address[1]}: {error.strerror}"
        raise DetectorError(why) from error
    return transport


class _Listener(asyncio.DatagramProtocol):
    def __init__(self, on_data: Callable[[bytes], None]) -> None:
        self._on_data = on_data

    @override
    def datagram_received(self, data: bytes, addr: object) -> None:
        self._on_data(data)
