"""Reports the radio lost at its first error, and recovered when no more errors come."""

import asyncio
from collections.abc import Callable

from onboard.observations import Sensor, SensorLost, SensorRecovered

RADIO_BACK_S = 4.0
"""Time without errors after which the radio counts as recovered.

An unreachable host causes an error every 3 s (ARP), a closed port every second.
"""


class RadioLoss:
    """Whether the radio is lost; one error comes for each frame that cannot be sent."""

    def __init__(self, take: Callable[[SensorLost | SensorRecovered], None]) -> None:
        """Report to `take`, from the running loop."""
        self._take = take
        self._loop = asyncio.get_running_loop()
        self._back: asyncio.TimerHandle | None = None

    def receive_error(self, why: str) -> None:
        """Report the radio lost, unless it is, and put off its recovery."""
        if self._back is None:
            self._take(SensorLost(self._loop.time(), Sensor.RADIO, silent_s=None, reason=why))
        else:
            self._back.cancel()
        self._back = self._loop.call_later(RADIO_BACK_S, self._recover)

    def close(self) -> None:
        """Report nothing more."""
        if self._back is not None:
            self._back.cancel()

    def _recover(self) -> None:
        self._back = None
        self._take(SensorRecovered(self._loop.time(), Sensor.RADIO))
