"""The warning list: who follows this car."""

import math
from collections import OrderedDict

from onboard.messages.lcca import CarId


class WarningList:
    """Each follower is on the list until it leaves or is not heard for `lifetime_s`.

    One car can be directly behind, but more may be listed for a while: one that cut in and the one
    behind it, or one that misread a plate. Being warned for nothing is the smaller harm. Nobody is
    refused, however many ask: whoever asks under many names must not keep the one behind from being
    warned. So everything here takes as long with thousands on the list as with one.
    """

    def __init__(self, lifetime_s: float) -> None:
        self._lifetime_s = lifetime_s
        self._until: OrderedDict[CarId, float] = OrderedDict()
        """The one heard longest ago first."""

    def __len__(self) -> int:
        return len(self._until)

    def __contains__(self, car_id: CarId) -> bool:
        return car_id in self._until

    @property
    def ids(self) -> tuple[CarId, ...]:
        """In the order in which they were last heard."""
        return tuple(self._until)

    def hear(self, car_id: CarId, now: float) -> bool:
        """That car asks to follow, or still does. Returns whether nobody did before."""
        was_empty = not self._until
        self._until[car_id] = now + self._lifetime_s
        self._until.move_to_end(car_id)
        return was_empty

    def remove(self, car_id: CarId) -> bool:
        """That car follows no longer. Returns whether it was the last one."""
        return self._until.pop(car_id, None) is not None and not self._until

    def expire(self, now: float) -> bool:
        """Drop those not heard for too long. Returns whether the last one was among them."""
        was_empty = not self._until
        while self._until and next(iter(self._until.values())) <= now:
            self._until.popitem(last=False)
        return not was_empty and not self._until

    def get_timer(self) -> float:
        """Return when the next follower expires; `math.inf` without followers."""
        return next(iter(self._until.values()), math.inf)
