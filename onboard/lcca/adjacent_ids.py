"""IDs of the adjacent epochs, translated to those of the own epoch.

All cars change their IDs at one time, each by its own clock. Around that time a message names cars
by the IDs of its sender's epoch, which may be the one before or after the own. Of four cars the
adjacent IDs are known: those of this car and of its lead by their plates, those of the leader by
the predecessor's replies (`Reply.next_leader_id`), and those of a follower by its joins
(`Join.previous_id`). They are translated where a message comes in, so the other parts of the
warning group see one ID for a car at any time.
"""

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

from onboard.messages.lcca import NO_ID, CarId, GroupMessage, Join, Leave, Reply, Update, Warn

MessageT = TypeVar("MessageT", Join, Reply, Leave, Update, Warn, GroupMessage)

_MAX_CARS = 16
"""Cars whose adjacent IDs are stored; the one stored first is dropped."""

_CAR_FIELDS: Mapping[type[GroupMessage], tuple[str, ...]] = {
    Join: ("sender_id", "leader_id", "to_id"),
    Reply: ("sender_id", "leader_id", "to_id"),
    Leave: ("sender_id", "leader_id", "to_id"),
    Update: ("sender_id", "leader_id", "previous_leader_id"),
    Warn: ("sender_id", "leader_id"),
}
"""Fields that name a car. The ID of an event stays: the braking car has signed it."""


class AdjacentIds:
    """Which IDs of the adjacent epochs belong to which ID of the own epoch."""

    def __init__(self, lifetime_s: float) -> None:
        """Know no IDs; previous ones stay valid for `lifetime_s` after the own change."""
        self._lifetime_s = lifetime_s
        self._next: OrderedDict[CarId, CarId] = OrderedDict()
        """Next ID by present ID, the newest at the end."""
        self._by_next: dict[CarId, CarId] = {}
        """Present ID by next ID."""
        self._by_previous: dict[CarId, CarId] = {}
        """Present ID by previous ID."""
        self._previous_own = NO_ID
        self._previous_until = float("-inf")

    def next_of(self, car_id: CarId) -> CarId:
        """Return the ID of a car in the next epoch; `NO_ID` if it is not known."""
        return self._next.get(car_id, NO_ID)

    def receive_next(self, car_id: CarId, next_id: CarId) -> None:
        """Take the ID that a car will have in the next epoch."""
        if self._next.get(car_id) == next_id:
            return
        self._next[car_id] = next_id
        if len(self._next) > _MAX_CARS:
            self._next.popitem(last=False)
        self._by_next = {later: present for present, later in self._next.items()}

    def receive_previous(self, car_id: CarId, previous_id: CarId) -> None:
        """Take the ID that a car had in the previous epoch."""
        self._by_previous[previous_id] = car_id

    def change_epoch(self, own_id: CarId, next_id: CarId, now: float) -> Mapping[CarId, CarId]:
        """Make the next IDs the present ones, and return these by those that are now previous.

        Args:
            own_id: the own ID until now.
            next_id: the own ID from now on.
            now: seconds on the cores' clock.
        """
        self._by_previous = {**self._next, own_id: next_id}
        self._previous_own = own_id
        self._previous_until = now + self._lifetime_s
        self._next.clear()
        self._by_next.clear()
        return self._by_previous

    def is_changing(self, now: float) -> bool:
        """Whether other cars may still use IDs of the previous epoch."""
        return now < self._previous_until

    def previous_own(self, now: float) -> CarId:
        """Return the own ID of the previous epoch, while others may use it; else `NO_ID`."""
        return self._previous_own if self.is_changing(now) else NO_ID

    def present(self, car_id: CarId, now: float) -> CarId:
        """Return the ID in the own epoch of a car, by one of an adjacent epoch if that is known."""
        return self._present(now).get(car_id, car_id)

    def _present(self, now: float) -> Mapping[CarId, CarId]:
        if self.is_changing(now):
            return {**self._by_previous, **self._by_next}
        return self._by_next

    def translated(self, message: MessageT, now: float) -> MessageT:
        """Return `message` with the IDs of the own epoch."""
        present = self._present(now)
        names: dict[str, Any] = {
            name: present[car_id]
            for name in _CAR_FIELDS[type(message)]
            if (car_id := getattr(message, name)) in present
        }
        return replace(message, **names) if names else message
