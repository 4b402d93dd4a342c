"""BSMs of one car of the MVS studies, composed by the cores of `onboard` from its bus and receiver.

So receivers get its acceleration and hard braking as late and as coarse as in a car.
"""

from collections import deque
from collections.abc import Sequence

import numpy as np

from onboard.bsm_transmission.transmitter import ACCELERATION_WINDOW_S, BsmTransmitter
from onboard.messages import bsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import VehicleSize
from onboard.obd.braking import Braking
from onboard.obd.settings import ObdSettings
from onboard.observations import HardBrake, Position, Speed
from onboard.security.pseudonyms import Pseudonym

TICK_S = 0.1
"""Interval of fixes, detections, BSMs and samples of the speed."""
_SAMPLES = round(ACCELERATION_WINDOW_S / TICK_S)


class BsmSource:
    """Bus and BSMs of one car."""

    def __init__(
        self,
        temporary_id: bytes,
        size_m: tuple[float, float],
        resolution_m_s: float,
        rng: np.random.Generator,
        utc_offset_s: float,
    ) -> None:
        """Know no speed yet.

        Args:
            temporary_id: of the BSMs, 4 bytes.
            size_m: length and width of the car.
            resolution_m_s: of the speeds on the bus.
            rng: of the transmitter.
            utc_offset_s: UTC less the study's time.
        """
        length_m, width_m = size_m
        self._resolution_m_s = resolution_m_s
        self._utc_offset_s = utc_offset_s
        self._braking = Braking(ObdSettings().hard_brake_threshold_g)
        pseudonym = Pseudonym(b"", temporary_id, 0, None, np.inf)
        size = VehicleSize(width_m=width_m, length_m=length_m)
        self._transmitter = BsmTransmitter(size, pseudonym, rng, 0.0)
        self._speeds: deque[Speed] = deque(maxlen=_SAMPLES)
        self.hard_brakes: list[HardBrake] = []
        """What the last sample of the speed shows of hard braking."""

    @property
    def speeds(self) -> Sequence[Speed]:
        """The last samples, the newest last."""
        return self._speeds

    def receive_earlier_speeds(
        self, speed_m_s: float, acceleration_m_s2: float, now: float
    ) -> None:
        """Let the car have driven before `now`, when its radio is switched on.

        Args:
            speed_m_s: at `now`.
            acceleration_m_s2: all the time.
            now: the time.
        """
        for tick in range(_SAMPLES - 1, 0, -1):
            earlier_s = tick * TICK_S
            earlier_m_s = max(speed_m_s - acceleration_m_s2 * earlier_s, 0.0)
            self.receive_speed(earlier_m_s, now - earlier_s)

    def receive_speed(self, speed_m_s: float, now: float) -> None:
        """Sample the true speed."""
        step_m_s = self._resolution_m_s
        speed = Speed(now, round(speed_m_s / step_m_s) * step_m_s, step_m_s, "study")
        self._speeds.append(speed)
        self._transmitter.receive_speed(speed)
        self._braking.receive_speed(speed, now)
        self._braking.handle_timer(now)
        self.hard_brakes.clear()
        while (brake := self._braking.next_event()) is not None:
            self._transmitter.receive_hard_brake(brake, now)
            self.hard_brakes.append(brake)

    def receive_position(self, fix: Position) -> None:
        """Take a fix of the car's receiver."""
        self._transmitter.receive_position(fix)

    def bsm(self, held_heading_rad: float | None, now: float) -> BasicSafetyMessage:
        """The BSM as receivers decode it, without a footer.

        Args:
            held_heading_rad: heading to send at standstill, clockwise from true north.
            now: the time.
        """
        message = self._transmitter.bsm(None, now, now + self._utc_offset_s, held_heading_rad)
        return bsm.decode(bsm.encode(message))
