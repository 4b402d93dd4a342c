"""The vehicles that follow this one, which the LCCA paper calls its warning list (section 3)."""

import math
from collections import OrderedDict
from dataclasses import dataclass

from onboard.lcca.parameters import GroupParameters
from onboard.messages.lcca import CarId


@dataclass(slots=True)
class _Follower:
    joined_at: float
    """Time of its last join."""
    received_at: float
    """Time of its last join or BSM."""


class Followers:
    """A vehicle is a follower until it leaves, is silent, or sends BSMs only for too long.

    Only one vehicle can be directly behind, but more may follow for a while: one that cut in and
    the one behind it, or one that misread a plate. A needless warning is the smaller harm. No join
    is refused, however many arrive: a sender of many identities must not keep the vehicle behind
    from being warned. Every operation therefore takes constant time, however many there are.
    """

    def __init__(self, parameters: GroupParameters) -> None:
        self._lifetime_s = parameters.membership_lifetime_s
        self._join_lifetime_s = parameters.join_lifetime_s
        self._followers: OrderedDict[CarId, _Follower] = OrderedDict()
        """The least recently received first."""

    def __len__(self) -> int:
        return len(self._followers)

    def __contains__(self, car_id: CarId) -> bool:
        return car_id in self._followers

    @property
    def ids(self) -> tuple[CarId, ...]:
        """IDs of the followers, the least recently received first."""
        return tuple(self._followers)

    def receive_join(self, car_id: CarId, now: float) -> bool:
        """Add a follower, or extend its lifetime. Return whether there was none before."""
        was_empty = not self._followers
        self._followers[car_id] = _Follower(now, now)
        self._followers.move_to_end(car_id)
        return was_empty

    def receive_bsm(self, car_id: CarId, now: float) -> bool:
        """Extend the lifetime of a follower, or remove one without a join for too long.

        Returns:
            whether the last one was removed.
        """
        follower = self._followers.get(car_id)
        if follower is None:
            return False
        if now >= follower.joined_at + self._join_lifetime_s:
            return self.remove(car_id)
        follower.received_at = now
        self._followers.move_to_end(car_id)
        return False

    def received_since(self, at_s: float) -> set[CarId]:
        """Return those from which a join or a BSM has arrived since then."""
        recent: set[CarId] = set()
        for car_id, follower in reversed(self._followers.items()):
            if follower.received_at < at_s:
                break
            recent.add(car_id)
        return recent

    def remove(self, car_id: CarId) -> bool:
        """Remove a follower that has left. Return whether it was the last one."""
        return self._followers.pop(car_id, None) is not None and not self._followers

    def expire(self, now: float) -> bool:
        """Remove followers whose lifetime is over. Return whether the last one was among them."""
        was_empty = not self._followers
        while self.get_timer() <= now:
            self._followers.popitem(last=False)
        return not was_empty and not self._followers

    def get_timer(self) -> float:
        """When the next follower expires; infinite without one."""
        first = next(iter(self._followers.values()), None)
        return math.inf if first is None else first.received_at + self._lifetime_s
