"""The UDP socket on which a test vehicle's controller receives requests to brake."""

import asyncio
import time
from collections.abc import Callable

from typing_extensions import override

from sim_rig.cars.brake_controller import BrakeController


async def open_controller_line(
    controller: BrakeController, at_s: Callable[[float], float]
) -> tuple[asyncio.DatagramTransport, int]:
    """Let `controller` receive datagrams at 127.0.0.1 until the transport is closed.

    Args:
        controller: of the car.
        at_s: time since the start of the scenario at a `now`, s.

    Returns:
        The transport, and its port.
    """
    transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
        lambda: _Receiver(controller, at_s), local_addr=("127.0.0.1", 0)
    )
    return transport, int(transport.get_extra_info("sockname")[1])


class _Receiver(asyncio.DatagramProtocol):
    def __init__(self, controller: BrakeController, at_s: Callable[[float], float]) -> None:
        self._controller = controller
        self._at_s = at_s

    @override
    def datagram_received(self, data: bytes, addr: object) -> None:
        self._controller.receive_bytes(data, self._at_s(time.monotonic()))
