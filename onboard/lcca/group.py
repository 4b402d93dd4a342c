"""One car's part in its warning group (LCCA, section 3): the core without I/O.

What this file does is to put the parts together: `lookout` says whom to follow, `membership` asks,
`place` numbers, `followers` lists who asked us, `forwarding` carries messages on, and `transitions`
alone decides the state. Where the paper is silent or the radio is not as kind as it assumes,
docs/decisions says what was chosen.
"""

import math
from collections import deque

import numpy as np

from onboard.lcca.acceptance import update_refusal, warn_refusal
from onboard.lcca.events import PrecedingVehicle, Transition, WarningRaised
from onboard.lcca.forwarding import EventId, Forwarding, Reach, event_of
from onboard.lcca.group_position import GroupPosition
from onboard.lcca.lead_monitor import LeadMonitor
from onboard.lcca.membership import Membership
from onboard.lcca.settings import LccaSettings
from onboard.lcca.transitions import GroupEvent, GroupState, next_state
from onboard.lcca.warning_list import WarningList
from onboard.messages.lcca import CarId, Join, LccaMessage, Leave, LeaveReason, Reply, Update, Warn
from onboard.observations import Discarded, HardBrake

__all__ = ["PrecedingVehicle", "WarningGroup"]

_SEQUENCES = 1 << 16
_NO_EVENT: EventId = (bytes(8), 0)
_MOST_OWED = 8
"""Acknowledgements owed at once; the oldest is dropped, and its warning repeated."""


class WarningGroup:
    """REGULAR, LEADER or MEMBER; joins, answers, warns and is warned."""

    def __init__(self, settings: LccaSettings, own_id: CarId, rng: np.random.Generator) -> None:
        """Start alone. `rng` spreads what many cars would send at once."""
        self._settings = settings
        self._renaming_until = math.inf
        self._state = GroupState.REGULAR
        self._place = GroupPosition(
            own_id, settings.leader_silence_s, int(rng.integers(_SEQUENCES))
        )
        self._lookout = LeadMonitor(settings)
        self._membership = Membership(settings, self._lookout, rng)
        self._followers = WarningList(settings.membership_lifetime_s)
        self._reach = Reach(settings)
        self._forwarding = Forwarding(settings, self._place, self._followers)
        self._event_sequence = int(rng.integers(_SEQUENCES))
        self._to_acknowledge: deque[EventId] = deque(maxlen=_MOST_OWED)
        self._outbox: list[LccaMessage] = []
        self._events: deque[Transition | WarningRaised | Discarded] = deque()

    @property
    def state(self) -> GroupState:
        """What this car is."""
        return self._state

    @property
    def leader_id(self) -> CarId:
        """The leader of the own group; a car that is REGULAR leads itself."""
        return self._place.leader_id

    @property
    def group_number(self) -> int:
        """1 unless MEMBER."""
        return self._place.number

    @property
    def predecessor_id(self) -> CarId | None:
        """The car that this one follows."""
        return self._membership.predecessor

    @property
    def followers(self) -> tuple[CarId, ...]:
        """The warning list."""
        return self._followers.ids

    def receive_speed(self, speed_m_s: float, now: float) -> None:
        """The own speed, from the car's bus."""
        self._lookout.receive_speed(speed_m_s, now)

    def receive_preceding_vehicle(self, ahead: PrecedingVehicle | None, now: float) -> None:
        """What one camera frame shows ahead in the own lane; `None`: no car."""
        self._lookout.receive_preceding_vehicle(ahead, now)
        self._membership.receive_frame(self._place.own_ids, now)
        self._join_if_due(now)

    def receive_hard_brake(self, brake: HardBrake, now: float) -> None:
        """The own car brakes hard: warn all behind in the group, and who joins them meanwhile."""
        warn = Warn(
            *self._place.header,
            event_origin_id=self._place.own_id,
            event_sequence=self._next_event_sequence(),
            reach=self._reach.distance(now),
            origin_number=self._place.number,
            deceleration_m_s2=brake.deceleration_m_s2,
            age_s=max(now - brake.stamp_s, 0.0),
            hops=1,
        )
        if self._state is not GroupState.REGULAR:
            self._outbox.append(warn)
        self._forwarding.originate(warn, now)

    def set_own_id(self, car_id: CarId, now: float) -> None:
        """The own plate's digest has changed, as everybody's does at about this time.

        Messages to the previous ID are taken for `rename_s` more.
        """
        self._renaming_until = now + self._settings.rename_s
        self._place.rename(car_id)
        self._membership.rename(now)

    def receive_message(self, message: LccaMessage, now: float) -> None:
        """A message from the air, whoever it is for."""
        if message.sender_id in self._place.own_ids:
            self._discard("own_echo", message, now)
            return
        distance = message.number - self._place.number
        if distance > 0 and message.leader_id == self._place.leader_id:
            self._reach.hear(message.sender_id, distance, now)
        match message:
            case Join():
                self._receive_join(message, now)
            case Reply():
                self._receive_reply(message, now)
            case Leave():
                self._receive_leave(message, now)
            case Update():
                self._receive_update(message, now)
            case Warn():
                self._receive_warn(message, now)

    def messages_to_send(self, now: float) -> list[LccaMessage]:  # noqa: ARG002 (the verb of all cores)
        """Take what is to be sent, the most urgent first."""
        out = sorted(self._outbox, key=lambda message: -message.user_priority)
        self._outbox.clear()
        return out

    def get_timer(self) -> float:
        """Return when `handle_timer` is due; `math.inf` when nothing is planned."""
        return min(
            self._membership.get_timer(),
            self._followers.get_timer(),
            self._forwarding.get_timer(),
            self._renaming_until,
        )

    def handle_timer(self, now: float) -> None:
        """Do what has become due."""
        if now >= self._renaming_until:
            self._place.drop_previous_id()
            self._renaming_until = math.inf
        if self._followers.expire(now):
            self._happen(GroupEvent.UNFOLLOWED, "expired", now)
        reason = self._membership.lapse(now)
        if reason is not None:
            self._leave(reason, now)
        self._join_if_due(now)
        self._forward_if_due(now)

    def next_event(self) -> Transition | WarningRaised | Discarded | None:
        """Take the oldest event."""
        return self._events.popleft() if self._events else None

    # Following the car ahead

    def _join_if_due(self, now: float) -> None:
        join = self._membership.next_join(now)
        if join is None:
            return
        heard = self._to_acknowledge.popleft() if self._to_acknowledge else _NO_EVENT
        self._outbox.append(Join(*self._place.header, *join, *heard))
        if self._to_acknowledge:
            self._membership.join_soon(now)

    def _receive_reply(self, reply: Reply, now: float) -> None:
        followed = self._membership.predecessor
        if reply.to_id not in self._place.own_ids:
            if reply.to_id == followed:
                moved = (reply.leader_id, reply.number + 2) != self._place.in_group
                news = self._place.is_news(reply.leader_id, reply.beat)
                self._membership.hear_predecessor_refresh(now, moved=moved, news=news)
            return
        refusal = self._membership.refusal(reply, now)
        if refusal is not None:
            self._discard(refusal, reply, now)
            return
        joins = reply.sender_id != followed
        place = (reply.leader_id, reply.number + 1)
        circle = self._place.closes_circle(*place, reply.beat, now)
        if circle and (joins or place != self._place.in_group):
            self._discard("loop", reply, now)
        if circle and joins:
            return
        news = not circle and self._place.is_news(reply.leader_id, reply.beat)
        self._membership.receive_reply(reply, news=news, now=now)
        if self._to_acknowledge:
            self._membership.join_soon(now)
        if joins and followed is not None and self._renaming_until == math.inf:
            self._send_leave(followed, LeaveReason.FOLLOWS_ANOTHER)
        if not circle:
            before = self._place.in_group
            self._move(place, reply.beat, GroupEvent.JOINED if joins else None, "answered", now)
            self._announce(before, now)

    def _leave(self, reason: LeaveReason, now: float) -> None:
        if self._membership.predecessor is not None:
            self._send_leave(self._membership.predecessor, reason)
        self._membership.leave(now)
        before = self._place.in_group
        self._place.lead()
        event = GroupEvent.LEFT_LEADING if self._followers else GroupEvent.LEFT_ALONE
        self._happen(event, reason.name.lower(), now)
        self._announce(before, now)

    def _send_leave(self, to_id: CarId, reason: LeaveReason) -> None:
        self._outbox.append(Leave(*self._place.header, to_id, reason))

    def _move(
        self, place: tuple[CarId, int], beat: int, event: GroupEvent | None, cause: str, now: float
    ) -> None:
        """Take a place as a member; without an `event` of its own it may mean a new number."""
        before = self._place.in_group
        self._place.take(*place, beat, now)
        if event is None and before != place:
            event = GroupEvent.RENUMBERED
        if event is not None:
            self._happen(event, cause, now)

    # Being followed

    def _receive_join(self, join: Join, now: float) -> None:
        is_for_us = join.to_id in self._place.own_ids
        if is_for_us and join.sender_id not in self._followers:
            self._forwarding.owe(join.sender_id, now)
        heard = (join.heard_origin_id, join.heard_sequence)
        if heard != _NO_EVENT and (is_for_us or join.leader_id == self._place.leader_id):
            behind = 1 if is_for_us else join.number - self._place.number
            self._forwarding.hear_acknowledgement(heard, join.sender_id, behind)
        if not is_for_us:
            return
        if join.sender_id in (self._membership.predecessor, self._place.leader_id):
            self._discard("loop", join, now)
        elif self._followers.hear(join.sender_id, now):
            self._happen(GroupEvent.FOLLOWED, "join", now)
        self._outbox.append(
            Reply(
                *self._place.header,
                to_id=join.sender_id,
                sequence=join.sequence,
                beat=self._place.next_beat(),
                speed_m_s=self._lookout.speed_at(now),
            )
        )

    def _receive_leave(self, leave: Leave, now: float) -> None:
        if leave.to_id in self._place.own_ids and self._followers.remove(leave.sender_id):
            self._happen(GroupEvent.UNFOLLOWED, "leave", now)

    # Telling those behind

    def _announce(self, before: tuple[CarId, int], now: float) -> None:
        """Send an update if our place has changed and somebody is behind to follow the change."""
        place = self._place
        leader_before, number_before = before
        shift = number_before - place.number
        renamed = self._renaming_until < math.inf and shift == 0
        if before == place.in_group or renamed or not self._followers:
            return
        update = Update(
            *place.header,
            event_origin_id=place.own_id,
            event_sequence=self._next_event_sequence(),
            reach=self._reach.distance(now),
            previous_leader_id=leader_before,
            shift=shift,
            beat=place.beat,
        )
        self._outbox.append(update)
        self._forwarding.originate(update, now)

    def _receive_update(self, update: Update, now: float) -> None:
        place = self._place
        if self._forwarding.knows(update):
            if update.leader_id == place.leader_id:
                self._forwarding.receive_again(update, place.number - update.number, now)
            self._discard("duplicate", update, now)
            return
        near = self._is_from_predecessor(update)
        number = update.number + 1 if near else place.number - update.shift
        refusal = update_refusal(update, number, self._state, place, from_predecessor=near, now=now)
        if refusal is not None:
            self._discard(refusal, update, now)
            return
        if place.is_news(update.leader_id, update.beat):
            self._membership.receive_news(now)
        before = place.in_group
        self._move((update.leader_id, number), update.beat, None, "update", now)
        if before == (update.previous_leader_id, number + update.shift):
            distance = number - update.number
            if self._forwarding.is_named_last(update, distance):
                self._acknowledge(update, distance, now)
            self._forwarding.receive(update, distance, now)
            self._forward_if_due(now)
        else:  # Those behind stand to us as before, but not to the sender: tell them ourselves.
            self._announce(before, now)

    def _receive_warn(self, warn: Warn, now: float) -> None:
        near = self._is_from_predecessor(warn)
        distance = 1 if near else self._place.number - warn.number
        if warn.event_origin_id in self._place.own_ids:
            refusal: str | None = "own_echo"
        elif self._forwarding.knows(warn):
            refusal = "duplicate"
            if near:  # It repeats because our acknowledgement was lost.
                self._acknowledge(warn, distance, now)
            if near or warn.leader_id == self._place.leader_id:
                self._forwarding.receive_again(warn, distance, now)
        else:
            refusal = warn_refusal(
                warn,
                self._state,
                self._place,
                from_predecessor=near,
                lifetime_s=self._settings.event_lifetime_s,
            )
        if refusal is not None:
            self._discard(refusal, warn, now)
            return
        self._events.append(
            WarningRaised(
                stamp_s=now,
                origin_id=warn.event_origin_id,
                sequence=warn.event_sequence,
                origin_number=warn.origin_number,
                group_number=self._place.number,
                leader_id=self._place.leader_id,
                deceleration_m_s2=warn.deceleration_m_s2,
                age_s=warn.age_s,
                hops=warn.hops,
            )
        )
        self._acknowledge(warn, distance, now)
        self._forwarding.receive(warn, distance, now)
        self._forward_if_due(now)

    def _acknowledge(self, message: Update | Warn, distance: int, now: float) -> None:
        """Name the message in the next join, and send that soon."""
        if event_of(message) not in self._to_acknowledge:
            self._to_acknowledge.append(event_of(message))
        if self._forwarding.is_named_last(message, distance):
            self._membership.join_at_once(now)
            self._join_if_due(now)
        else:
            self._membership.join_soon(now)

    def _forward_if_due(self, now: float) -> None:
        if now < self._forwarding.get_timer():
            return
        is_member = self._state is GroupState.MEMBER
        reach = self._reach.distance(now)
        self._outbox += self._forwarding.copies_to_send(reach, is_member=is_member, now=now)

    def _is_from_predecessor(self, message: LccaMessage) -> bool:
        return message.sender_id == self._membership.predecessor

    def _next_event_sequence(self) -> int:
        self._event_sequence = (self._event_sequence + 1) % _SEQUENCES
        return self._event_sequence

    def _happen(self, event: GroupEvent, cause: str, now: float) -> None:
        before, self._state = self._state, next_state(self._state, event)
        self._events.append(
            Transition(
                stamp_s=now,
                event=event,
                state_before=before,
                state=self._state,
                leader_id=self._place.leader_id,
                group_number=self._place.number,
                cause=cause,
            )
        )

    def _discard(self, reason: str, message: LccaMessage, now: float) -> None:
        detail = f"{message.kind} from {message.sender_id.hex()}"
        self._events.append(Discarded(now, "lcca", reason, detail))
