"""Who repeats an update or a warning, without anybody's position.

The LCCA paper mentions such a scheme and leaves it out; this one is ours.

Going out. Every message tells where its sender stands in the group. So each car knows how many cars
behind itself its radio has lately been heard to reach (taking radio as symmetric), and names that
`reach` in what it sends. The car that far behind repeats at once, naming its own reach. The others
that heard it wait, those nearer to the named one shorter, and stay silent once a car at least as
far behind as themselves has repeated. A car without followers never repeats; if it is the named
one, it acknowledges at once instead, and that silences the others too. While the named ones hear,
the copies are those of a shortest path down the group, and there is no way to do with fewer.

Getting there (warnings only). A warned car brings the refreshing of its membership forward and
names the warning in it, so the acknowledgement is a message that was due anyway. A car repeats the
warning to a follower that owes it one, a bounded number of times.
"""

import math
from collections import OrderedDict, deque
from dataclasses import dataclass, field, replace

from onboard.lcca.group_position import GroupPosition
from onboard.lcca.settings import LccaSettings
from onboard.lcca.warning_list import WarningList
from onboard.messages.lcca import CarId, Update, Warn

EventId = tuple[CarId, int]
"""Who started it, and its count there."""

_LATELY = 3.0
"""For how many refreshings of its membership a car once heard counts as within reach."""

_REMEMBERED = 32
"""Acknowledgements kept of messages that are not known here yet."""

_MOST_KNOWN = 64
"""Messages of others known at a time. A group has more only if somebody makes them up."""


def event_of(message: Update | Warn) -> EventId:
    """Return what all copies of one message share."""
    return message.event_origin_id, message.event_sequence


class Reach:
    """How far behind in the group the radio reaches."""

    def __init__(self, settings: LccaSettings) -> None:
        self._lifetime_s = _LATELY * settings.refresh_s
        self._heard: OrderedDict[CarId, tuple[int, float]] = OrderedDict()
        """The car heard longest ago first."""

    def hear(self, car_id: CarId, distance: int, now: float) -> None:
        """A car of the own group, `distance` > 0 cars behind, was heard."""
        self._heard[car_id] = (distance, now)
        self._heard.move_to_end(car_id)
        self._forget(now)

    def distance(self, now: float) -> int:
        """Return how many cars behind the farthest car lately heard drives; 0 if there is none.

        Never more than the number of cars heard: one that makes up a large number raises it by one.
        """
        self._forget(now)
        farthest = max((distance for distance, _ in self._heard.values()), default=0)
        return min(farthest, len(self._heard))

    def _forget(self, now: float) -> None:
        while self._heard and next(iter(self._heard.values()))[1] < now - self._lifetime_s:
            self._heard.popitem(last=False)


@dataclass(slots=True)
class _Known:
    """A message on its way through the group, as this car knows it."""

    message: Update | Warn
    """The copy that came, or the original."""
    heard_at: float
    distance: int
    """To the sender of the best copy, the one least far ahead; 0: this car started it."""
    repeat_at: float | None
    """When it is this car's turn, if nobody farther behind repeats before."""
    check_at: float | None
    """When the followers' acknowledgements are to be there."""
    repeats_left: int
    owing: set[CarId] = field(default_factory=set)
    """Followers that have not acknowledged."""


class Forwarding:
    """Decides when this car repeats what it knows."""

    def __init__(
        self, settings: LccaSettings, place: GroupPosition, followers: WarningList
    ) -> None:
        self._settings = settings
        self._place = place
        self._followers = followers
        self._known: dict[EventId, _Known] = {}
        self._acknowledged: deque[tuple[EventId, CarId]] = deque(maxlen=_REMEMBERED)

    def knows(self, message: Update | Warn) -> bool:
        """Whether a copy came before."""
        return event_of(message) in self._known

    def originate(self, message: Update | Warn, now: float) -> None:
        """This car starts the message, and sends its first copy now."""
        self._learn(message, 0, None, now)

    def receive(self, message: Update | Warn, distance: int, now: float) -> None:
        """A first copy from a car `distance` ahead; if negative, one behind has repeated it."""
        repeat_at = now + self._wait_s(message.reach, distance) if distance > 0 else None
        self._learn(message, distance, repeat_at, now)

    def receive_again(self, message: Update | Warn, distance: int, now: float) -> None:
        """Another copy, from a car `distance` ahead, or as far behind if that is negative."""
        known = self._known[event_of(message)]
        if known.repeat_at is None:
            return
        if distance <= 0:
            known.repeat_at = None
        elif distance < known.distance:
            known.message, known.distance = message, distance
            known.heard_at = now
            known.repeat_at = now + self._wait_s(message.reach, distance)

    def owe(self, car_id: CarId, now: float) -> None:
        """That car follows from now on: tell it, after its reply, if this one has just braked.

        Of brakings farther ahead it is not told. They may have been in another lane.
        """
        horizon = now - self._settings.event_lifetime_s
        for known in self._known.values():
            is_own_braking = isinstance(known.message, Warn) and known.distance == 0
            if is_own_braking and known.heard_at >= horizon:
                known.owing.add(car_id)
                known.repeats_left = self._settings.warn_repeats
                known.check_at = known.check_at or now + self._settings.slot_s

    def hear_acknowledgement(self, event: EventId, car_id: CarId, behind: int) -> None:
        """A car of the own group, `behind` cars behind, says that it has heard this event.

        If it is the named one it has repeated it, or has nobody behind to repeat it to.
        """
        known = self._known.get(event)
        if known is None:
            if (event, car_id) not in self._acknowledged:
                self._acknowledged.append((event, car_id))
            return
        known.owing.discard(car_id)
        if behind == known.message.reach - known.distance:
            known.repeat_at = None

    def is_named_last(self, message: Update | Warn, distance: int) -> bool:
        """Whether we are to repeat it and have nobody to repeat it to: then we say so at once."""
        return message.reach == distance and not self._followers

    def get_timer(self) -> float:
        """Return when a copy may be due; `math.inf` when none is planned."""
        due = [at for known in self._known.values() for at in (known.repeat_at, known.check_at)]
        return min((at for at in due if at is not None), default=math.inf)

    def copies_to_send(self, reach: int, *, is_member: bool, now: float) -> list[Update | Warn]:
        """Return what this car is to repeat now, as it looks from where the car stands now."""
        due = [
            known
            for known in self._known.values()
            if any((self._has_turn(known, now), self._lacks_answer(known, now)))
        ]
        copies = (
            self._copy(known, reach, now) for known in due if known.distance == 0 or is_member
        )
        return [copy for copy in copies if copy is not None]

    def _copy(self, known: _Known, reach: int, now: float) -> Update | Warn | None:
        message, (sender_id, leader_id, number) = known.message, self._place.header
        if isinstance(message, Update):
            if message.leader_id != leader_id:
                return None
            return replace(message, sender_id=sender_id, number=number, reach=reach)
        age_s = message.age_s + (now - known.heard_at)
        # Since it came we may have been renumbered, and the braking car with us.
        origin_number = message.origin_number + number - (message.number + known.distance)
        if age_s > self._settings.event_lifetime_s or origin_number < 1:
            return None
        return replace(
            message,
            sender_id=sender_id,
            leader_id=leader_id,
            number=number,
            reach=reach,
            origin_number=origin_number,
            age_s=age_s,
            hops=min(message.hops + (known.distance != 0), 255),
        )

    def _has_turn(self, known: _Known, now: float) -> bool:
        if known.repeat_at is None or now < known.repeat_at:
            return False
        known.repeat_at = None
        return bool(known.owing) if isinstance(known.message, Warn) else len(self._followers) > 0

    def _lacks_answer(self, known: _Known, now: float) -> bool:
        if known.check_at is None or now < known.check_at:
            return False
        known.owing.intersection_update(self._followers.ids)
        if not known.owing or known.repeats_left == 0:
            known.check_at = None
            return False
        known.check_at = now + self._settings.acknowledge_s
        known.repeats_left -= 1
        return True

    def _learn(
        self, message: Update | Warn, distance: int, repeat_at: float | None, now: float
    ) -> None:
        event = event_of(message)
        owing = set(self._followers.ids)
        owing -= {car_id for heard, car_id in self._acknowledged if heard == event}
        check_at = now + self._settings.acknowledge_s if isinstance(message, Warn) else None
        self._known[event] = _Known(
            message, now, distance, repeat_at, check_at, self._settings.warn_repeats, owing
        )
        horizon = now - 2 * self._settings.event_lifetime_s
        self._known = {key: old for key, old in self._known.items() if old.heard_at >= horizon}
        others = [key for key, known in self._known.items() if known.distance != 0]
        for key in others[:-_MOST_KNOWN]:
            del self._known[key]

    def _wait_s(self, reach: int, distance: int) -> float:
        """How long to wait for others to repeat, before this car does.

        The named car does not wait, the one behind it half a slot, the one ahead of it a slot, and
        so on. Nobody waits longer than for an acknowledgement: otherwise a car that lies about its
        number could stop the news.
        """
        slots = abs(reach - distance) - (0.5 if distance > reach else 0.0)
        return min(slots * self._settings.slot_s, self._settings.acknowledge_s)
