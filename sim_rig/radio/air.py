"""The air between the radio units: one interface, two models behind it.

`reach` (`reach.py`) lets everybody hear whom a scenario wants it to hear, late, lost or twice.
`csma` (`csma_air.py`) is the 802.11p channel (`channel.py`). Live and virtual runs use either.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from sim_rig.roads.road import CarState

CarsAt = Callable[[float], Mapping[str, CarState]]
"""Where the cars are at a moment."""
LOOK_EVERY_S = 0.1
"""The air looks this often where they are."""


@dataclass(frozen=True, slots=True, order=True)
class Delivery:
    """One copy of a frame on its way to one receiver."""

    at_s: float
    order: int
    """Frames that arrive together arrive as they were sent."""
    sender: str = field(compare=False)
    receiver: str = field(compare=False)
    user_priority: int = field(compare=False)
    wsm: bytes = field(compare=False)


class Air(Protocol):
    """What carries frames from unit to unit."""

    def receive_wsm(self, sender: str, wsm: bytes, user_priority: int, now: float) -> None:
        """The unit of `sender` is given a frame to transmit."""
        ...

    def wsms_to_deliver(self, now: float) -> list[Delivery]:
        """The copies that have arrived by now, in order."""
        ...

    def get_timer(self) -> float:
        """Return when the next copy arrives; `math.inf` when none is in flight."""
        ...
