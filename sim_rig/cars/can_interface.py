"""An ECU on a CAN interface of this computer's kernel, an adapter or vcan, or on a serial line."""

import asyncio
import math
from collections.abc import Callable
from pathlib import Path

from onboard.obd.can_bus import CanBus
from onboard.obd.can_frame import CanFrame
from onboard.obd.settings import CanSettings
from sim_rig.cars.ecu import Ecu
from sim_rig.cars.faulty_ecu import FaultyEcu
from sim_rig.cars.slcan_line import SlcanLine


class CanInterface:
    """Answers on the interface, also after it was down."""

    def __init__(
        self,
        ecu: Ecu | FaultyEcu,
        interface: str | Path,
        on_answer: Callable[[CanFrame], None] = lambda _frame: None,
        on_late: Callable[[float], None] = lambda _late_s: None,
    ) -> None:
        """Open the interface on the running event loop.

        Args:
            ecu: the control unit on the bus.
            interface: such as can0 or vcan0; a path is that of a serial line with slcan.
            on_answer: called with each frame that the ECU sends.
            on_late: called with the lateness of each turn of the ECU, s.

        Raises:
            UserError: the interface cannot be opened.
        """
        self._loop = asyncio.get_running_loop()
        self._ecu = ecu
        self._on_answer = on_answer
        self._on_late = on_late
        self._timer: asyncio.TimerHandle | None = None
        self._bus = open_interface(interface, self._receive)
        self._bus.start(self._loop)
        self._arm()

    def close(self) -> None:
        """Leave the bus."""
        if self._timer is not None:
            self._timer.cancel()
        self._bus.close()

    def _receive(self, frame: CanFrame) -> None:
        self._ecu.receive_frame(frame, self._loop.time())
        self._arm()

    def _arm(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        at = self._ecu.get_timer()
        self._timer = self._loop.call_at(at, self._answer) if at < math.inf else None

    def _answer(self) -> None:
        now = self._loop.time()
        if self._ecu.get_timer() <= now:
            self._on_late(now - self._ecu.get_timer())
        for frame in self._ecu.frames_to_send(now):
            self._bus.send(frame)
            self._on_answer(frame)
        self._arm()


def open_interface(
    interface: str | Path, on_frame: Callable[[CanFrame], None]
) -> CanBus | SlcanLine:
    """Return the bus of an interface, which is still to be started; see `CanInterface`."""
    if isinstance(interface, Path):
        return SlcanLine(interface, on_frame)
    settings = CanSettings(interface="socketcan", channel=interface)
    return CanBus(settings, on_frame, lambda _up, _why: None)
