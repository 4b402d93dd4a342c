"""Speeds of one car of the MVS studies as its bus has them, and the hard braking that they show.

So receivers get its acceleration and hard braking as late and as coarse as in a car.
"""

from collections.abc import Iterator

from onboard.bsm_transmission.transmitter import ACCELERATION_WINDOW_S
from onboard.obd.braking import Braking
from onboard.obd.settings import ObdSettings
from onboard.observations import HardBrake, Speed

TICK_S = 0.1
"""Interval of fixes, detections, BSMs and samples of the speed."""
_SAMPLES = round(ACCELERATION_WINDOW_S / TICK_S)


class SampledBus:
    """Bus of one car."""

    def __init__(self, resolution_m_s: float) -> None:
        """Start without a speed, whose resolution is given."""
        self._resolution_m_s = resolution_m_s
        self._braking = Braking(ObdSettings().hard_brake_threshold_g)

    def earlier_samples(
        self, speed_m_s: float, acceleration_m_s2: float, now: float
    ) -> Iterator[Speed | HardBrake]:
        """Yield what the bus has shown before `now`, when the radio is switched on.

        Args:
            speed_m_s: at `now`.
            acceleration_m_s2: all the time.
            now: the time.
        """
        for tick in range(_SAMPLES - 1, 0, -1):
            earlier_s = tick * TICK_S
            earlier_m_s = max(speed_m_s - acceleration_m_s2 * earlier_s, 0.0)
            yield from self.sample(earlier_m_s, now - earlier_s)

    def sample(self, speed_m_s: float, now: float) -> Iterator[Speed | HardBrake]:
        """Yield what the bus shows of the true speed."""
        step_m_s = self._resolution_m_s
        speed = Speed(now, round(speed_m_s / step_m_s) * step_m_s, step_m_s, "study")
        self._braking.receive_speed(speed, now)
        self._braking.handle_timer(now)
        yield speed
        yield from iter(self._braking.next_event, None)
