"""Which member repeats an update or a warning, decided from group numbers without positions.

The LCCA paper mentions such a scheme and omits it; this one is ours.

Dissemination. Every message carries its sender's group number. Each vehicle therefore knows how
many vehicles behind it were received lately (radio links are taken as symmetric), and sends that
number as `reach`. The member that far behind, the designated forwarder, repeats at once with its
own reach. The others that received the copy wait, those nearer to the designated one for a shorter
time, and cancel their copy when a vehicle at least as far behind as themselves has repeated. A
vehicle without followers never repeats; if it is the designated forwarder it acknowledges at once
instead, which cancels the others' copies too. If every designated forwarder receives its copy, the
copies are those of a shortest path down the group, which is the minimum.

Reliability (warnings only). A warned member advances the next refresh of its membership and names
the warning in it, so the acknowledgement is a message that was due anyway. A vehicle repeats the
warning while a follower has not acknowledged it, a bounded number of times, at times with a random
part: two vehicles that do not hear each other would collide each time. A newer warning of the same
vehicle replaces the older one.
"""

import math
from collections import OrderedDict, deque
from dataclasses import dataclass, field, replace

import numpy as np

from onboard.lcca.followers import Followers
from onboard.lcca.group_position import GroupPosition
from onboard.lcca.parameters import GroupParameters
from onboard.messages.lcca import CarId, Update, Warn, WarnCause

EventId = tuple[CarId, int]
"""ID of the vehicle that started it, and its event sequence number."""

_Statement = tuple[EventId, type[Update] | type[Warn], CarId | None, int, int]
"""What all copies of a message have in common."""

SAME_STATEMENT_S = 0.5
"""Largest difference between the times of two copies of a warning. Its vehicle sends the next one
after `warn_refresh_s`; a copy may wait for the radio."""

_EARLY_S = 0.5
"""An acknowledgement comes so long before the acknowledged message at most."""

_REACH_REFRESHES = 3.0
"""A vehicle is within reach for this many refresh intervals after a message from it."""

_MAX_EARLY_ACKNOWLEDGEMENTS = 32
"""Stored acknowledgements of messages that were not received yet."""

_MAX_MESSAGES = 64
"""Stored messages of others. Only an attacker makes a group have more."""


def event_of(message: Update | Warn) -> EventId:
    """Return the ID of the event, which all copies of one message share."""
    return message.event_origin_id, message.event_sequence


def _statement_of(message: Update | Warn) -> _Statement:
    """Return what is stated: whoever uses a number ahead of its vehicle states something else."""
    event = event_of(message)
    if isinstance(message, Update):
        return event, Update, message.leader_id, message.shift, message.leader_sequence
    return event, Warn, None, message.first_sequence, int(message.cause is WarnCause.OVER)


def reach_of_cause(cause: WarnCause | int, reach: int) -> int:
    """Return how many vehicles behind a warning is repeated: its end, by the next one each time."""
    return min(reach, 1) if cause is WarnCause.OVER else reach


class Reach:
    """How many vehicles behind in the group the radio reaches."""

    def __init__(self, parameters: GroupParameters) -> None:
        self._lifetime_s = _REACH_REFRESHES * parameters.refresh_s
        self._received: OrderedDict[CarId, tuple[int, float]] = OrderedDict()
        """Distance and time of the last message, the oldest first."""

    def receive_distance(self, car_id: CarId, distance: int, now: float) -> None:
        """Note a message from a vehicle of the own group, `distance` > 0 vehicles behind.

        Args:
            car_id: its sender.
            distance: difference of the group numbers.
            now: seconds on the cores' clock.
        """
        self._forget(now)
        self._received[car_id] = (distance, now)
        self._received.move_to_end(car_id)

    def distance(self, now: float) -> int:
        """Return how many vehicles behind the farthest one received lately is; 0 without any.

        Never more than the number of vehicles received: a forged group number raises it by one.
        """
        horizon = now - self._lifetime_s
        recent = [distance for distance, at in self._received.values() if at >= horizon]
        return min(max(recent, default=0), len(recent))

    def _forget(self, now: float) -> None:
        while self._received and next(iter(self._received.values()))[1] < now - self._lifetime_s:
            self._received.popitem(last=False)


@dataclass(slots=True)
class _Message:
    """An update or a warning that was received or started, and what this vehicle still does."""

    message: Update | Warn
    """The copy that was received, or the original."""
    received_at: float
    distance: int
    """To the nearest sender ahead of whom a copy was received; 0: this vehicle started it."""
    repeat_at: float
    """When to repeat it unless a vehicle farther behind repeats before; infinite: never."""
    check_at: float
    """When the followers' acknowledgements are checked; infinite: never."""
    repeats_left: int
    unacknowledged: set[CarId] = field(default_factory=set)
    """Followers that have not acknowledged it."""
    is_replaced: bool = False
    """Whether a newer warning of the same vehicle is stored."""


class Forwarding:
    """Decides when this vehicle repeats updates and warnings."""

    def __init__(
        self,
        parameters: GroupParameters,
        position: GroupPosition,
        followers: Followers,
        reach: Reach,
        rng: np.random.Generator,
    ) -> None:
        """Start without messages.

        Args:
            parameters: times and limits of the warning group.
            position: position of this vehicle in its group.
            followers: followers of this vehicle, which must acknowledge.
            reach: how many vehicles behind this one its radio reaches.
            rng: draws the spread of repetitions.
        """
        self._parameters = parameters
        self._position = position
        self._followers = followers
        self._reach = reach
        self._rng = rng
        self._messages: dict[_Statement, _Message] = {}
        self._early_acknowledgements: deque[tuple[EventId, CarId, float]] = deque(
            maxlen=_MAX_EARLY_ACKNOWLEDGEMENTS
        )

    def is_duplicate(self, message: Update | Warn, now: float) -> bool:
        """Whether a copy was received before, or this vehicle started it."""
        entry = self._messages.get(_statement_of(message))
        if entry is None or not isinstance(message, Warn) or not isinstance(entry.message, Warn):
            return entry is not None
        made_at, known_at = now - message.age_s, entry.received_at - entry.message.age_s
        return abs(made_at - known_at) <= SAME_STATEMENT_S

    def originate(self, message: Update | Warn, now: float) -> None:
        """Start the message; the caller sends its first copy now."""
        self._store(message, 0, math.inf, now)

    def receive_first(self, message: Update | Warn, distance: int, now: float) -> None:
        """Take a first copy.

        Args:
            message: the copy.
            distance: how many vehicles ahead its sender is; negative: behind.
            now: seconds on the cores' clock.
        """
        repeat_at = now + self._wait_s(message.reach, distance, now) if distance > 0 else math.inf
        self._store(message, distance, repeat_at, now)

    def receive_duplicate(self, message: Update | Warn, distance: int, now: float) -> None:
        """Take another copy; arguments as in `receive_first`."""
        entry = self._messages[_statement_of(message)]
        if entry.repeat_at == math.inf:
            return
        if distance <= 0:
            entry.repeat_at = math.inf
        elif distance < entry.distance:
            entry.message, entry.distance = message, distance
            entry.received_at = now
            entry.repeat_at = now + self._wait_s(message.reach, distance, now)

    def receive_late(self, message: Warn, distance: int, now: float) -> None:
        """Take a warning that is accepted some time after its reception.

        The other members had their turn to repeat it. Followers that do not acknowledge it get it.
        Arguments as in `receive_first`.
        """
        self._store(message, distance, math.inf, now)

    def add_recipient(self, car_id: CarId, now: float, *, is_close: bool) -> None:
        """Send a new follower, after its reply, the warnings of brakings that last.

        Args:
            car_id: the follower. It may have received them, and acknowledges them with its next
                join.
            now: seconds on the cores' clock.
            is_close: whether this vehicle's camera shows its predecessor now. If not, it may have
                left the lane, and only its own braking concerns the follower.
        """
        for entry in self._messages.values():
            if not isinstance(entry.message, Warn) or entry.message.cause is WarnCause.OVER:
                continue
            if entry.distance != 0 and not is_close:
                continue
            age_s = entry.message.age_s + now - entry.received_at
            if not entry.is_replaced and age_s <= self._parameters.event_lifetime_s:
                entry.unacknowledged.add(car_id)
                entry.repeats_left = self._parameters.warn_repeats
                if entry.check_at == math.inf:
                    entry.check_at = now + self._parameters.slot_s + self._spread_s()

    def rename(self, old_id: CarId, new_id: CarId) -> None:
        """Take the new ID of a follower."""
        for entry in self._messages.values():
            if old_id in entry.unacknowledged:
                entry.unacknowledged.remove(old_id)
                entry.unacknowledged.add(new_id)

    def drop_own_warnings(self) -> None:
        """Drop the own warnings: their name is that of the last epoch."""
        self._messages = {
            key: each
            for key, each in self._messages.items()
            if each.distance != 0 or isinstance(each.message, Update)
        }

    def drop_others(self) -> None:
        """Drop all that other vehicles started: this vehicle has left their group."""
        self._messages = {key: each for key, each in self._messages.items() if each.distance == 0}

    def receive_acknowledgement(
        self, event: EventId, car_id: CarId, behind: int, now: float
    ) -> None:
        """Take the acknowledgement of an event by a vehicle of the own group.

        The designated forwarder has repeated the message, or has no follower to repeat it to.

        Args:
            event: what is acknowledged.
            car_id: the sender of the acknowledgement.
            behind: how many vehicles behind it is.
            now: seconds on the cores' clock.
        """
        entries = [each for key, each in self._messages.items() if key[0] == event]
        if not entries:
            self._early_acknowledgements.append((event, car_id, now))
        for entry in entries:
            entry.unacknowledged.discard(car_id)
            if behind == entry.message.reach - entry.distance:
                entry.repeat_at = math.inf

    def is_last_forwarder(self, message: Update | Warn, distance: int) -> bool:
        """Whether this vehicle is the designated forwarder and has no follower to repeat it to."""
        return message.reach == distance and not self._followers

    def get_timer(self) -> float:
        """When a copy may be due; infinite if none is planned."""
        due = (min(entry.repeat_at, entry.check_at) for entry in self._messages.values())
        return min(due, default=math.inf)

    def copies_to_send(self, *, is_member: bool, now: float) -> list[Update | Warn]:
        """Return the copies that are due, with this vehicle's present leader and number.

        Args:
            is_member: whether this vehicle is a member; others repeat only what they started.
            now: seconds on the cores' clock.
        """
        due = [
            entry
            for entry in self._messages.values()
            if any((self._take_repeat(entry, now), self._take_check(entry, now)))
        ]
        copies = (self._copy(entry, now) for entry in due if entry.distance == 0 or is_member)
        return [copy for copy in copies if copy is not None]

    def _copy(self, entry: _Message, now: float) -> Update | Warn | None:
        reach = self._reach.distance(now)
        message, (sender_id, leader_id, number) = entry.message, self._position.header
        if isinstance(message, Update):
            if message.leader_id != leader_id:
                return None
            return replace(message, sender_id=sender_id, number=number, reach=reach)
        age_s = message.age_s + (now - entry.received_at)
        # Since it was received, this vehicle and the braking one may have been renumbered.
        origin_number = message.origin_number + number - (message.number + entry.distance)
        if age_s > self._parameters.event_lifetime_s or origin_number < 1:
            return None
        return replace(
            message,
            sender_id=sender_id,
            leader_id=leader_id,
            number=number,
            reach=reach_of_cause(message.cause, reach),
            origin_number=origin_number,
            age_s=age_s,
            hops=min(message.hops + (entry.distance != 0), 255),
        )

    def _take_repeat(self, entry: _Message, now: float) -> bool:
        """Take the repetition that is due; return whether followers need it."""
        if now < entry.repeat_at:
            return False
        entry.repeat_at = math.inf
        return (
            bool(entry.unacknowledged)
            if isinstance(entry.message, Warn)
            else len(self._followers) > 0
        )

    def _take_check(self, entry: _Message, now: float) -> bool:
        """Take the check that is due, and plan the next; return whether to repeat it again."""
        if now < entry.check_at:
            return False
        entry.unacknowledged.intersection_update(self._followers.ids)
        if not entry.unacknowledged or entry.repeats_left == 0:
            entry.check_at = math.inf
            return False
        entry.check_at = now + self._parameters.acknowledge_s + self._spread_s()
        entry.repeats_left -= 1
        return True

    def _store(self, message: Update | Warn, distance: int, repeat_at: float, now: float) -> None:
        event = event_of(message)
        unacknowledged = set(self._followers.ids)
        unacknowledged -= {
            car_id
            for acknowledged, car_id, at in self._early_acknowledgements
            if acknowledged == event and now - at <= _EARLY_S
        }
        check_at = math.inf
        if isinstance(message, Warn):
            check_at = now + self._parameters.acknowledge_s + self._spread_s()
            self._replace(message.event_origin_id)
        self._messages[_statement_of(message)] = _Message(
            message,
            now,
            distance,
            repeat_at,
            check_at,
            self._parameters.warn_repeats,
            unacknowledged,
        )
        horizon = now - 2 * self._parameters.event_lifetime_s
        self._messages = {
            key: old for key, old in self._messages.items() if old.received_at >= horizon
        }
        others = [key for key, entry in self._messages.items() if entry.distance != 0]
        for key in others[:-_MAX_MESSAGES]:
            del self._messages[key]

    def _replace(self, origin_id: CarId) -> None:
        """Repeat the stored warnings of that vehicle no more."""
        for entry in self._messages.values():
            if isinstance(entry.message, Warn) and entry.message.event_origin_id == origin_id:
                entry.repeat_at = entry.check_at = math.inf
                entry.is_replaced = True

    def _spread_s(self) -> float:
        return float(self._rng.uniform(0.0, self._parameters.spread_s))

    def _wait_s(self, reach: int, distance: int, now: float) -> float:
        """How long to wait for copies of others before repeating.

        The designated forwarder does not wait, the vehicle behind it waits half a slot, the one
        ahead of it one slot, and so on. The radio of a vehicle ahead reaches no farther behind than
        the own one, so a forged reach delays by the slots of the own reach at most. The wait is
        bounded by the time for an acknowledgement.
        """
        reach = min(reach, distance + self._reach.distance(now))
        slots = abs(reach - distance) - (0.5 if distance > reach else 0.0)
        return min(slots * self._parameters.slot_s, self._parameters.acknowledge_s)
