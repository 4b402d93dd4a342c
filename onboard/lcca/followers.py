"""The vehicles that follow this one, which the LCCA paper calls its warning list (section 3)."""

import math
from collections import OrderedDict

from onboard.messages.lcca import CarId


class Followers:
    """A vehicle is a follower until it leaves or sends no join for `lifetime_s`.

    Only one vehicle can be directly behind, but more may follow for a while: one that cut in and
    the one behind it, or one that misread a plate. A needless warning is the smaller harm. No join
    is refused, however many arrive: a sender of many identities must not keep the vehicle behind
    from being warned. Every operation therefore takes constant time, however many there are.
    """

    def __init__(self, lifetime_s: float) -> None:
        self._lifetime_s = lifetime_s
        self._until: OrderedDict[CarId, float] = OrderedDict()
        """Expiry times, the least recently refreshed first."""

    def __len__(self) -> int:
        return len(self._until)

    def __contains__(self, car_id: CarId) -> bool:
        return car_id in self._until

    @property
    def ids(self) -> tuple[CarId, ...]:
        """IDs of the followers, the least recently refreshed first."""
        return tuple(self._until)

    def refresh(self, car_id: CarId, now: float) -> bool:
        """Add a follower, or extend its lifetime. Return whether there was none before."""
        was_empty = not self._until
        self._until[car_id] = now + self._lifetime_s
        self._until.move_to_end(car_id)
        return was_empty

    def joined_since(self, at_s: float) -> set[CarId]:
        """Return those that have sent a join since then."""
        recent: set[CarId] = set()
        for car_id, until in reversed(self._until.items()):
            if until < at_s + self._lifetime_s:
                break
            recent.add(car_id)
        return recent

    def remove(self, car_id: CarId) -> bool:
        """Remove a follower that has left. Return whether it was the last one."""
        return self._until.pop(car_id, None) is not None and not self._until

    def expire(self, now: float) -> bool:
        """Remove followers whose lifetime is over. Return whether the last one was among them."""
        was_empty = not self._until
        while self._until and next(iter(self._until.values())) <= now:
            self._until.popitem(last=False)
        return not was_empty and not self._until

    def get_timer(self) -> float:
        """When the next follower expires; infinite without one."""
        return next(iter(self._until.values()), math.inf)
