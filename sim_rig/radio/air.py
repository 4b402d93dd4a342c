"""Interface of the radio channel between the units, with three models.

`reach` (`reach.py`) has connectivity, delay, loss and duplication by the scenario. `csma` is the
802.11p channel (`channel.py`), `sidelink` that of C-V2X (`sidelink.py`), both by `channel_air.py`.
Live and virtual runs use any.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from sim_rig.roads.road import CarState

CarsAt = Callable[[float], Mapping[str, CarState]]
"""States of all cars at a `now`."""
POSITION_INTERVAL_S = 0.1
"""Interval at which the channel updates the cars' positions."""


@dataclass(frozen=True, slots=True, order=True)
class Delivery:
    """One copy of a frame for one receiver."""

    at_s: float
    order: int
    """Copies with equal `at_s` arrive in the order of sending."""
    sender: str = field(compare=False)
    receiver: str = field(compare=False)
    user_priority: int = field(compare=False)
    wsm: bytes = field(compare=False)


class Air(Protocol):
    """A model of the radio channel."""

    def receive_wsm(self, sender: str, wsm: bytes, user_priority: int, now: float) -> None:
        """Pass a frame to the radio unit of its sender.

        Args:
            sender: name of the sending car.
            wsm: the frame.
            user_priority: its user priority, 0 to 7.
            now: monotonic time, s.
        """
        ...

    def wsms_to_deliver(self, now: float) -> list[Delivery]:
        """Return the copies that have arrived by `now`, in order."""
        ...

    def get_timer(self) -> float:
        """Return when the next copy arrives; `math.inf` when none is in flight."""
        ...
