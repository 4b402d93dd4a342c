"""Which member repeats a warning, decided from group numbers without positions.

The LCCA paper mentions such a scheme and omits it; this one is ours.

Dissemination. Every message carries its sender's group number. Each vehicle therefore knows how
many vehicles behind it were received lately (radio links are taken as symmetric), and sends that
number as `reach`. The member that far behind, the designated forwarder, repeats at once with its
own reach. The others that received the copy wait, those nearer to the designated one for a shorter
time, and cancel their copy when a vehicle at least as far behind as themselves has repeated. A
vehicle without followers never repeats; if it is the designated forwarder it acknowledges at once
instead, which cancels the others' copies too. If every designated forwarder receives its copy, the
copies are those of a shortest path down the group, which is the minimum.

Reliability. A warned member advances the next refresh of its membership and names
the warning in it, so the acknowledgement is a message that was due anyway. A vehicle repeats the
warning while a follower has not acknowledged it, a bounded number of times, at times with a random
part: two vehicles that do not hear each other would collide each time. A newer warning of the same
vehicle replaces the older one.

Whoever sends a copy chooses its age, numbers and reach. So a copy never takes the place of one that
is known: it tells only that somebody has repeated it, which may delay the own repetition until
acknowledgements are checked.
"""

import math
from collections import OrderedDict, deque
from dataclasses import dataclass, field, replace

import numpy as np

from onboard.lcca.followers import Followers
from onboard.lcca.group_position import GroupPosition
from onboard.lcca.parameters import GroupParameters
from onboard.messages.lcca import CarId, Warn, WarnCause

EventId = tuple[CarId, int]
"""ID of the vehicle that started it, and its event sequence number."""

_Statement = tuple[EventId, int, bool]
"""What all copies of a warning have in common: event, first sequence number, and whether it is the
end. Whoever uses a number ahead of its vehicle states something else."""

SAME_STATEMENT_S = 0.5
"""By which a copy of a known warning may seem newer than it, and one of an older warning too. Its
vehicle sends the next one after `warn_refresh_s`; a copy may wait for the radio."""

_EARLY_S = 0.5
"""An acknowledgement comes so long before the acknowledged message at most."""

_SILENT_S = 0.65
"""A follower without a join or BSM for so long, or since the IDs have changed, has another ID by
now, or is out of reach: it is sent no repetition. Without BSMs, it sends a join after `refresh_s`
and one every `retry_s` from then on."""

_REACH_REFRESHES = 3.0
"""A vehicle is within reach for this many refresh intervals after a message or BSM from it."""

_MAX_EARLY_ACKNOWLEDGEMENTS = 32
"""Stored acknowledgements of messages that were not received yet."""

_MAX_MESSAGES = 64
"""Stored warnings of others. Only an attacker makes a group have more."""


def event_of(warn: Warn) -> EventId:
    """Return the ID of the event, which all copies of one warning share."""
    return warn.event_origin_id, warn.event_sequence


def _statement_of(warn: Warn) -> _Statement:
    return event_of(warn), warn.first_sequence, warn.cause is WarnCause.OVER


def _made_at(warn: Warn, now: float) -> float:
    """Return when what is stated began: as its vehicle has signed, or else as the copy says."""
    return now - warn.age_s if warn.stated_at_s is None else warn.stated_at_s


@dataclass(slots=True)
class _Received:
    """A vehicle behind in the group."""

    distance: int
    """As its last message has it."""
    stated_at: float
    """Time of that message."""
    at: float
    """Time of its last message or BSM."""


class Reach:
    """How many vehicles behind in the group the radio reaches."""

    def __init__(self, parameters: GroupParameters, *, proves_ids: bool = False) -> None:
        self._proves_ids = proves_ids
        self._lifetime_s = _REACH_REFRESHES * parameters.refresh_s
        self._join_lifetime_s = parameters.join_lifetime_s
        self._received: OrderedDict[CarId, _Received] = OrderedDict()
        """The least recently received first."""

    def receive_distance(self, car_id: CarId, distance: int, now: float) -> None:
        """Note a message from a vehicle of the own group, `distance` > 0 vehicles behind.

        Args:
            car_id: its sender.
            distance: difference of the group numbers.
            now: seconds on the cores' clock.
        """
        self._forget(now)
        self._received[car_id] = _Received(distance, now, now)
        self._received.move_to_end(car_id)

    def receive_bsm(self, car_id: CarId, now: float) -> None:
        """Note that a vehicle is still within reach, at the distance in its last message."""
        known = self._received.get(car_id)
        if known is not None and now < known.stated_at + self._join_lifetime_s:
            known.at = now
            self._received.move_to_end(car_id)

    def distance(self, now: float) -> int:
        """Return how many vehicles behind the farthest one received lately is; 0 without any.

        Never more than the number of vehicles received: a forged group number raises it by one.
        """
        horizon = now - self._lifetime_s
        recent = [each.distance for each in self._received.values() if each.at >= horizon]
        return min(max(recent, default=0), len(recent))

    def of_cause(self, cause: WarnCause | int, now: float) -> int:
        """Return how many vehicles behind a warning is to be repeated.

        The end of a braking that is not proved is believed by the next vehicle only.
        """
        distance = self.distance(now)
        return min(distance, 1) if cause is WarnCause.OVER and not self._proves_ids else distance

    def _forget(self, now: float) -> None:
        while self._received and next(iter(self._received.values())).at < now - self._lifetime_s:
            self._received.popitem(last=False)


@dataclass(slots=True)
class _Message:
    """A warning that was received or started, and what this vehicle still does."""

    warn: Warn
    """The copy that was received first, or the original."""
    made_at: float
    received_at: float
    origin_ahead: int
    """How many vehicles ahead the braking one is."""
    distance: int
    """To the nearest sender ahead of whom a copy was received; 0 if this vehicle started it, or of
    one that follows the same vehicle."""
    reach: int
    """That this sender named."""
    repeat_at: float
    """When to repeat it unless a vehicle farther behind repeats before; infinite: never."""
    check_at: float
    """When the followers' acknowledgements are checked; infinite: never."""
    repeats_left: int
    is_own: bool
    """Whether this vehicle started it."""
    unacknowledged: set[CarId] = field(default_factory=set)
    """Followers that have not acknowledged it."""
    is_replaced: bool = False
    """Whether a newer warning of the same vehicle is stored."""


class Forwarding:
    """Decides when this vehicle repeats warnings."""

    def __init__(
        self,
        parameters: GroupParameters,
        position: GroupPosition,
        followers: Followers,
        reach: Reach,
        rng: np.random.Generator,
    ) -> None:
        """Start without warnings.

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
        self._changed_at = -math.inf
        self._early_acknowledgements: deque[tuple[EventId, CarId, float]] = deque(
            maxlen=_MAX_EARLY_ACKNOWLEDGEMENTS
        )

    def is_duplicate(self, warn: Warn, now: float) -> bool:
        """Whether a copy was received before that is as new, or this vehicle started it.

        Whoever sends a copy first may pretend that it is old, so that its warning soon ends: a much
        newer one is no copy of it.
        """
        entry = self._messages.get(_statement_of(warn))
        if entry is None:
            return False
        is_as_new = now - warn.age_s <= entry.received_at - entry.warn.age_s + SAME_STATEMENT_S
        return is_as_new and _made_at(warn, now) <= entry.made_at + SAME_STATEMENT_S

    def originate(self, warn: Warn, now: float) -> None:
        """Start the warning; the caller sends its first copy now."""
        self._store(warn, 0, math.inf, now, is_own=True)

    def receive_first(self, warn: Warn, distance: int, now: float) -> None:
        """Take a first copy.

        Args:
            warn: the copy.
            distance: how many vehicles ahead its sender is; negative: behind.
            now: seconds on the cores' clock.
        """
        repeat_at = now + self._wait_s(warn.reach, distance, now) if distance > 0 else math.inf
        self._store(warn, distance, repeat_at, now)

    def receive_duplicate(self, warn: Warn, distance: int, now: float) -> None:
        """Take another copy; arguments as in `receive_first`."""
        entry = self._messages[_statement_of(warn)]
        if entry.repeat_at == math.inf:
            return
        if distance <= 0:
            entry.repeat_at = math.inf
        elif distance < entry.distance:
            entry.distance, entry.reach = distance, warn.reach
            entry.repeat_at = now + self._wait_s(warn.reach, distance, now)

    def receive_late(self, warn: Warn, distance: int, now: float) -> None:
        """Take a warning that is accepted some time after its reception.

        The other members had their turn to repeat it. Followers that do not acknowledge it get it.
        Arguments as in `receive_first`.
        """
        self._store(warn, distance, math.inf, now)

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
            if entry.warn.cause is WarnCause.OVER or not (entry.is_own or is_close):
                continue
            age_s = entry.warn.age_s + now - entry.received_at
            if not entry.is_replaced and age_s <= self._parameters.event_lifetime_s:
                entry.unacknowledged.add(car_id)
                entry.repeats_left = self._parameters.warn_repeats
                if entry.check_at == math.inf:
                    entry.check_at = now + self._parameters.slot_s + self._spread_s()

    def change_epoch(self, now: float) -> None:
        """Drop the own warnings, whose name is that of the last epoch; so are the followers'."""
        self._changed_at = now
        self._messages = {key: each for key, each in self._messages.items() if not each.is_own}

    def drop_others(self) -> None:
        """Drop all that other vehicles started: this vehicle has left their group."""
        self._messages = {key: each for key, each in self._messages.items() if each.is_own}

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
            if behind == entry.reach - entry.distance:
                entry.repeat_at = math.inf

    def is_last_forwarder(self, warn: Warn, distance: int) -> bool:
        """Whether this vehicle is the designated forwarder and has no follower to repeat it to."""
        return warn.reach == distance and not self._followers

    def get_timer(self) -> float:
        """When a copy may be due; infinite if none is planned."""
        if not self._messages:
            return math.inf
        return min(min(entry.repeat_at, entry.check_at) for entry in self._messages.values())

    def copies_to_send(self, *, is_member: bool, now: float) -> list[Warn]:
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
        copies = (self._copy(entry, now) for entry in due if entry.is_own or is_member)
        return [copy for copy in copies if copy is not None]

    def _copy(self, entry: _Message, now: float) -> Warn | None:
        warn, (sender_id, leader_id, number) = entry.warn, self._position.header
        age_s = warn.age_s + (now - entry.received_at)
        # Since it was received, this vehicle and the braking one may have been renumbered.
        origin_number = number - entry.origin_ahead
        if age_s > self._parameters.event_lifetime_s or origin_number < 1:
            return None
        return replace(
            warn,
            sender_id=sender_id,
            leader_id=leader_id,
            number=number,
            reach=self._reach.of_cause(warn.cause, now),
            origin_number=origin_number,
            age_s=age_s,
            hops=min(warn.hops + (not entry.is_own), 255),
        )

    def _take_repeat(self, entry: _Message, now: float) -> bool:
        """Take the repetition that is due; return whether followers need it."""
        if now < entry.repeat_at:
            return False
        entry.repeat_at = math.inf
        return bool(entry.unacknowledged)

    def _take_check(self, entry: _Message, now: float) -> bool:
        """Take the check that is due, and plan the next; return whether to repeat it again."""
        if now < entry.check_at:
            return False
        entry.unacknowledged.intersection_update(self._followers.ids)
        if not entry.unacknowledged or entry.repeats_left == 0:
            entry.check_at = math.inf
            return False
        entry.check_at = now + self._parameters.acknowledge_s + self._spread_s()
        received_at = max(now - _SILENT_S, self._changed_at)
        if entry.unacknowledged.isdisjoint(self._followers.received_since(received_at)):
            return False
        entry.repeats_left -= 1
        return True

    def _store(
        self, warn: Warn, distance: int, repeat_at: float, now: float, *, is_own: bool = False
    ) -> None:
        event = event_of(warn)
        unacknowledged = set(self._followers.ids)
        unacknowledged -= {
            car_id
            for acknowledged, car_id, at in self._early_acknowledgements
            if acknowledged == event and now - at <= _EARLY_S
        }
        made_at = _made_at(warn, now)
        self._replace(warn.event_origin_id, made_at)
        self._messages[_statement_of(warn)] = _Message(
            warn,
            made_at,
            now,
            warn.number + distance - warn.origin_number,
            distance,
            warn.reach,
            repeat_at,
            now + self._parameters.acknowledge_s + self._spread_s(),
            self._parameters.warn_repeats,
            is_own,
            unacknowledged,
        )
        horizon = now - 2 * self._parameters.event_lifetime_s
        self._messages = {
            key: old for key, old in self._messages.items() if old.received_at >= horizon
        }
        others = [key for key, entry in self._messages.items() if not entry.is_own]
        for key in others[:-_MAX_MESSAGES]:
            del self._messages[key]

    def _replace(self, origin_id: CarId, made_at: float) -> None:
        """Repeat the older warnings of that vehicle no more."""
        for entry in self._messages.values():
            if (
                entry.warn.event_origin_id == origin_id
                and entry.made_at <= made_at + SAME_STATEMENT_S
            ):
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
