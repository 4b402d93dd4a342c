"""IDs of the adjacent epochs, translated to those of the own epoch.

All cars change their IDs at one time, each by its own clock. Around that time a message names cars
by the IDs of its sender's epoch, which may be the one before or after the own. Those of this car
and of its lead are known by their plates. They are translated where a message comes in, so the
other parts of the warning group see one ID for a car at any time.

The next ID of the leader is known by the predecessor's replies only (`Reply.next_leader_id`), who
may name any car. So it tells which group a message is of, never who sends it or who brakes.
"""

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

from onboard.messages.lcca import NO_ID, CarId, GroupMessage, Join, Leave, Reply, Update, Warn

MessageT = TypeVar("MessageT", Join, Reply, Leave, Update, Warn, GroupMessage)

_MAX_CARS = 16
"""Cars whose adjacent IDs are stored; the one stored first is dropped."""


class Renamed(NamedTuple):
    """IDs of the own epoch, by those of an adjacent one."""

    cars: Mapping[CarId, CarId]
    """Whoever is named: known by plates."""
    leaders: Mapping[CarId, CarId]
    """Where a leader is named: as others say, too."""


class AdjacentIds:
    """Which IDs of the adjacent epochs belong to which ID of the own epoch."""

    def __init__(self, lifetime_s: float) -> None:
        """Know no IDs; previous ones stay valid for `lifetime_s` after the own change."""
        self._lifetime_s = lifetime_s
        self._next: OrderedDict[CarId, CarId] = OrderedDict()
        """Next ID by present ID, the newest at the end."""
        self._next_leader: dict[CarId, CarId] = {}
        """The same of the leader, as the predecessor says."""
        self._by_next = Renamed({}, {})
        self._by_previous = Renamed({}, {})
        self._previous_until = float("-inf")

    def next_of(self, car_id: CarId) -> CarId:
        """Return the ID of a leader in the next epoch; `NO_ID` if it is not known."""
        return self._next.get(car_id) or self._next_leader.get(car_id, NO_ID)

    def receive_next(self, car_id: CarId, next_id: CarId) -> None:
        """Take the ID that a car will have in the next epoch, by its plate."""
        if self._next.get(car_id) == next_id:
            return
        self._next[car_id] = next_id
        if len(self._next) > _MAX_CARS:
            self._next.popitem(last=False)
        self._invert()

    def receive_next_leader(self, leader_id: CarId, next_id: CarId) -> None:
        """Take what the predecessor says of its leader's ID in the next epoch."""
        self._next_leader = {leader_id: next_id}
        self._invert()

    def _invert(self) -> None:
        cars = {later: present for present, later in self._next.items()}
        leaders = {later: present for present, later in self._next_leader.items()}
        self._by_next = Renamed(cars, leaders | cars)

    def receive_previous(self, car_id: CarId, previous_id: CarId) -> None:
        """Take the ID that a car had in the previous epoch, by its plate."""
        by_previous = {previous_id: car_id}
        cars, leaders = self._by_previous
        self._by_previous = Renamed({**cars, **by_previous}, {**leaders, **by_previous})

    def change_epoch(self, own_id: CarId, next_id: CarId, now: float) -> Renamed:
        """Make the next IDs the present ones, and return these by those that are now previous.

        Args:
            own_id: the own ID until now.
            next_id: the own ID from now on.
            now: seconds on the cores' clock.
        """
        cars = {**self._next, own_id: next_id}
        self._by_previous = Renamed(cars, {**self._next_leader, **cars})
        self._previous_until = now + self._lifetime_s
        self._next.clear()
        self._next_leader.clear()
        self._by_next = Renamed({}, {})
        return self._by_previous

    def is_changing(self, now: float) -> bool:
        """Whether other cars may still use IDs of the previous epoch."""
        return now < self._previous_until

    def present(self, car_id: CarId, now: float) -> CarId:
        """Return the ID in the own epoch of a car, by one of an adjacent epoch if that is known."""
        return self._present(now).cars.get(car_id, car_id)

    def _present(self, now: float) -> Renamed:
        if not self.is_changing(now):
            return self._by_next
        return Renamed(
            {**self._by_previous.cars, **self._by_next.cars},
            {**self._by_previous.leaders, **self._by_next.leaders},
        )

    def translated(self, message: MessageT, now: float) -> MessageT:
        """Return `message` with the IDs of the own epoch; that of an event stays: it is signed."""
        cars, leaders = self._present(now)
        names: dict[str, Any] = {
            name: cars[getattr(message, name)]
            for name in ("sender_id", "to_id")
            if getattr(message, name, NO_ID) in cars
        }
        if message.leader_id in leaders:
            names["leader_id"] = leaders[message.leader_id]
        return replace(message, **names) if names else message
