"""IDs of the adjacent epochs, translated to those of the own epoch.

All cars change their IDs at one time, each by its own clock. Around that time a message names cars
by the IDs of its sender's epoch, which may be the one before or after the own. Those of this car
and of its lead are known by their plates. They are translated where a message comes in, so the
other parts of the warning group see one ID for a car at any time.

The new ID of a leader that is no lead comes as any other leader's does: by an update of the
predecessor.
"""

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

from onboard.messages.lcca import NO_ID, CarId, GroupMessage, Join, Leave, Reply, Update, Warn

MessageT = TypeVar("MessageT", Join, Reply, Leave, Update, Warn, GroupMessage)

_MAX_CARS = 16
"""Cars whose adjacent IDs are stored; the one stored first is dropped."""

Renamed = Mapping[CarId, CarId]
"""IDs of the own epoch, by those of an adjacent one."""


class AdjacentIds:
    """Which IDs of the adjacent epochs belong to which ID of the own epoch."""

    def __init__(self, lifetime_s: float) -> None:
        """Know no IDs; previous ones stay valid for `lifetime_s` after the own change."""
        self._lifetime_s = lifetime_s
        self._next: OrderedDict[CarId, CarId] = OrderedDict()
        """Next ID by present ID, the newest at the end."""
        self._by_next: Renamed = {}
        self._by_previous: dict[CarId, CarId] = {}
        self._previous_until = float("-inf")

    def receive_next(self, car_id: CarId, next_id: CarId) -> None:
        """Take the ID that a car will have in the next epoch, by its plate."""
        if self._next.get(car_id) == next_id:
            return
        self._next[car_id] = next_id
        if len(self._next) > _MAX_CARS:
            self._next.popitem(last=False)
        self._by_next = {later: present for present, later in self._next.items()}

    def receive_previous(self, car_id: CarId, previous_id: CarId) -> None:
        """Take the ID that a car had in the previous epoch, by its plate."""
        self._by_previous[previous_id] = car_id

    def change_epoch(self, own_id: CarId, next_id: CarId, now: float) -> Renamed:
        """Make the next IDs the present ones, and return these by those that are now previous.

        Args:
            own_id: the own ID until now.
            next_id: the own ID from now on.
            now: seconds on the cores' clock.
        """
        self._by_previous = {**self._next, own_id: next_id}
        self._previous_until = now + self._lifetime_s
        self._next.clear()
        self._by_next = {}
        return self._by_previous

    def present(self, car_id: CarId, now: float) -> CarId:
        """Return the ID in the own epoch of a car, by one of an adjacent epoch if that is known."""
        return self._present(now).get(car_id, car_id)

    def _present(self, now: float) -> Renamed:
        if now >= self._previous_until:
            return self._by_next
        return {**self._by_previous, **self._by_next}

    def translated(self, message: MessageT, now: float) -> MessageT:
        """Return `message` with the IDs of the own epoch; that of an event stays: it is signed."""
        names = self._present(now)
        changed: dict[str, Any] = {
            field: names[getattr(message, field)]
            for field in ("sender_id", "to_id", "leader_id")
            if getattr(message, field, NO_ID) in names
        }
        return replace(message, **changed) if changed else message
