"""The UDP socket on which a test vehicle's controller receives requests to brake."""

import asyncio
import time
from collections.abc import Callable

from typing_extensions import override

from sim_rig.cars.brake_controller import BrakeController


async def open_controller_line(
    controller: BrakeController, at_s: Callable[[float], float], host: str, port: int
) -> asyncio.DatagramTransport:
    """Let `controller` receive datagrams until the transport is closed.

    Args:
        controller: of the car.
        at_s: time since the start of the scenario at a `now`, s.
        host: address at which it receives.
        port: UDP port at which it receives.
    """
    transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
        lambda: _Receiver(controller, at_s), local_addr=(host, port)
    )
    return transport


class _Receiver(asyncio.DatagramProtocol):
    def __init__(self, controller: BrakeController, at_s: Callable[[float], float]) -> None:
        self._controller = controller
        self._at_s = at_s

    @override
    def datagram_received(self, data: bytes, addr: object) -> None:
        self._controller.receive_bytes(data, self._at_s(time.monotonic()))
