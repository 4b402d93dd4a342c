"""One vehicle's part in its warning group (LCCA, section 3): the core without I/O.

It puts the parts together: `lead_monitor` tells whether to join the lead, `membership` sends joins,
`group_position` holds leader and number, `followers` who follows, `own_braking` the own state,
`active_warnings` that of the vehicles ahead, `forwarding` repeats messages, and `transitions` alone
decides the state in the group. docs/design/lcca.md states what the paper leaves open.
"""

from collections import deque

import numpy as np
from typing_extensions import override

from onboard.core import Core
from onboard.lcca.acceptance import warn_refusal
from onboard.lcca.active_warnings import ActiveWarnings
from onboard.lcca.adjacent_ids import AdjacentIds, Renamed
from onboard.lcca.events import (
    MeasuredLead,
    Transition,
    WarningLevel,
    WarningOver,
    WarningRaised,
)
from onboard.lcca.followers import Followers
from onboard.lcca.forwarding import EventId, Forwarding, Reach, event_of
from onboard.lcca.group_position import LARGEST_ADVANCE, GroupPosition
from onboard.lcca.lead_monitor import LeadMonitor
from onboard.lcca.membership import Membership
from onboard.lcca.own_braking import OwnBraking
from onboard.lcca.parameters import GroupParameters
from onboard.lcca.refused_warnings import RefusedWarnings
from onboard.lcca.transitions import GroupEvent, GroupState, next_state
from onboard.messages.lcca import (
    NO_ID,
    CarId,
    GroupMessage,
    Join,
    Leave,
    LeaveReason,
    Reply,
    Update,
    Warn,
)
from onboard.observations import Discarded, HardBrake

__all__ = ["MeasuredLead", "WarningGroup"]

GroupEvents = Transition | WarningRaised | WarningLevel | WarningOver | Discarded

_SEQUENCES = 1 << 16
_NO_EVENT: EventId = (NO_ID, 0)
_REFUSED_BY_GROUP = ("not_in_group", "other_group")
"""Reasons that end when the vehicle joins that group."""
_MAX_ACKNOWLEDGEMENTS = 8
"""Acknowledgements waiting to be sent; the oldest is dropped, and its warning repeated."""


class WarningGroup(Core):
    """State, membership, followers and forwarding of one vehicle."""

    def __init__(
        self,
        parameters: GroupParameters,
        own_id: CarId,
        rng: np.random.Generator,
        *,
        proves_ids: bool = False,
    ) -> None:
        """Start as REGULAR.

        Args:
            parameters: of the protocol.
            own_id: the own communication ID.
            rng: for start values of sequence numbers and random delays.
            proves_ids: whether certificates name the IDs of their vehicles: what a braking vehicle
                has signed is then its own statement, whoever repeats it.
        """
        self._proves_ids = proves_ids
        self._parameters = parameters
        self._rng = rng
        self._adjacent_ids = AdjacentIds(parameters.id_change_s)
        self._state = GroupState.REGULAR
        self._position = GroupPosition(
            own_id, parameters.leader_silence_s, int(rng.integers(_SEQUENCES))
        )
        self._lead_monitor = LeadMonitor(parameters)
        self._membership = Membership(parameters, self._lead_monitor, rng)
        self._followers = Followers(parameters)
        self._reach = Reach(parameters, proves_ids=proves_ids)
        self._forwarding = Forwarding(parameters, self._position, self._followers, self._reach, rng)
        self._own_braking = OwnBraking(parameters, rng)
        self._active_warnings = ActiveWarnings(parameters)
        self._refused_warnings = RefusedWarnings(parameters.event_lifetime_s)
        self._event_sequence = int(rng.integers(_SEQUENCES))
        self._to_acknowledge: deque[EventId] = deque(maxlen=_MAX_ACKNOWLEDGEMENTS)
        self._to_answer: list[Join] = []
        self._outbox: list[GroupMessage] = []
        self._events: deque[GroupEvents] = deque()

    @property
    def state(self) -> GroupState:
        """REGULAR, LEADER or MEMBER."""
        return self._state

    @property
    def leader_id(self) -> CarId:
        """The leader of the own group; the own ID if REGULAR."""
        return self._position.leader_id

    @property
    def group_number(self) -> int:
        """1 unless MEMBER."""
        return self._position.number

    @property
    def predecessor_id(self) -> CarId | None:
        """The vehicle that this one follows."""
        return self._membership.predecessor

    @property
    def followers(self) -> tuple[CarId, ...]:
        """IDs of the vehicles that follow this one."""
        return self._followers.ids

    def receive_speed(self, speed_m_s: float, now: float) -> None:
        """Take a sample of the own speed."""
        self._lead_monitor.receive_speed(speed_m_s, now)

    def receive_lead(
        self, lead: MeasuredLead | None, now: float, *, is_unknown: bool = False
    ) -> None:
        """Take what one camera frame shows of the lead.

        Args:
            lead: the lead vehicle, if it shows one.
            now: seconds on the cores' clock.
            is_unknown: whether one may be there although the frame shows none.
        """
        if lead is not None and lead.car_id is not None:
            if lead.next_id is not None:
                self._adjacent_ids.receive_next(lead.car_id, lead.next_id)
            if lead.previous_id is not None:
                self._adjacent_ids.receive_previous(lead.car_id, lead.previous_id)
                names = {lead.previous_id: lead.car_id}
                self._rename(Renamed(names, names))
        self._lead_monitor.receive_lead(lead, now, is_unknown=is_unknown)
        self._membership.receive_frame(self._position.own_id, now)
        self._join_if_due(now)

    def receive_hard_brake(self, brake: HardBrake, now: float) -> None:
        """Warn the members behind, and all that join while it lasts, of the own hard braking."""
        self._own_braking.receive_hard_brake(brake, self._position.own_id, now)
        self._send_braking_if_due(now)

    def has_ahead(self, warn: Warn, now: float) -> bool:
        """Whether a vehicle that sent this warning itself so states to be ahead in this group."""
        own = self._adjacent_ids.translated(warn, now)
        if self._is_from_predecessor(own):
            return True
        return own.leader_id == self.leader_id and own.number < self.group_number

    def receive_next_own_id(self, next_id: CarId) -> None:
        """Take the own ID of the next epoch: others may use it before this vehicle does."""
        self._adjacent_ids.receive_next(self._position.own_id, next_id)

    def set_own_id(self, car_id: CarId, now: float) -> None:
        """Take the own ID of a new epoch; all vehicles change theirs at about this time.

        The predecessor takes this one for another follower, and hears at once what was received.

        Sequence numbers begin anew, and a braking that lasts has a new name, so that they do not
        link the IDs.
        """
        self._rename(self._adjacent_ids.change_epoch(self._position.own_id, car_id, now))
        self._event_sequence = int(self._rng.integers(_SEQUENCES))
        self._forwarding.change_epoch(now)
        self._own_braking.rename(car_id, now)
        self._position.advance(int(self._rng.integers(1, LARGEST_ADVANCE)))
        self._membership.change_sequence()
        self._to_acknowledge.extend(map(event_of, self._active_warnings.warnings))
        self._membership.join_soon(now)

    def _rename(self, names: Renamed) -> None:
        self._position.rename(names.leaders)
        self._lead_monitor.rename(names.cars)
        self._membership.rename(names.cars)
        self._active_warnings.rename(names.cars)

    def receive_message(self, message: GroupMessage, now: float) -> None:
        """Take a message from the radio, to whichever vehicle it is addressed."""
        message = self._adjacent_ids.translated(message, now)
        if message.sender_id == self._position.own_id:
            self._discard("own_echo", message, now)
            return
        distance = message.number - self._position.number
        if distance > 0 and message.leader_id == self._position.leader_id:
            self._reach.receive_distance(message.sender_id, distance, now)
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

    def receive_bsm(self, car_id: CarId, now: float) -> None:
        """Take that a BSM of this vehicle has arrived: it is still there, and within reach."""
        car_id = self._adjacent_ids.present(car_id, now)
        self._membership.receive_bsm(car_id, now)
        self._reach.receive_bsm(car_id, now)
        if self._followers.receive_bsm(car_id, now):
            self._apply_event(GroupEvent.UNFOLLOWED, "expired", now)

    def messages_to_send(self, now: float) -> list[GroupMessage]:
        """Return the messages to send, the most urgent first, and clear the outbox."""
        replies = [self._reply(join, now) for join in self._to_answer]
        out = sorted([*self._outbox, *replies], key=lambda message: -message.user_priority)
        self._to_answer.clear()
        self._outbox.clear()
        return out

    @override
    def get_timer(self) -> float:
        """When `handle_timer` is due; infinite if nothing is planned."""
        return min(
            self._membership.get_timer(),
            self._followers.get_timer(),
            self._forwarding.get_timer(),
            self._own_braking.get_timer(),
            self._active_warnings.get_timer(),
        )

    @override
    def handle_timer(self, now: float) -> None:
        """Do what has become due."""
        if self._followers.expire(now):
            self._apply_event(GroupEvent.UNFOLLOWED, "expired", now)
        reason = self._membership.expire(now)
        if reason is not None:
            self._leave(reason, now)
        self._join_if_due(now)
        self._send_braking_if_due(now)
        self._events.extend(self._active_warnings.expire(now))
        self._forward_if_due(now)

    @override
    def next_event(self) -> GroupEvents | None:
        """Return the oldest event not yet taken, or `None`."""
        return self._events.popleft() if self._events else None

    # Following the predecessor

    def _join_if_due(self, now: float) -> None:
        join = self._membership.next_join(now)
        if join is None:
            return
        acknowledged = self._to_acknowledge.popleft() if self._to_acknowledge else _NO_EVENT
        self._outbox.append(Join(*self._position.header, *join, *acknowledged))
        if self._to_acknowledge:
            self._membership.join_soon(now)

    def _receive_reply(self, reply: Reply, now: float) -> None:
        followed = self._membership.predecessor
        if reply.to_id != self._position.own_id:
            if reply.to_id == followed:
                moved = (reply.leader_id, reply.number + 2) != self._position.in_group
                newer = self._position.is_newer(reply.leader_id, reply.leader_sequence)
                self._membership.receive_predecessor_reply(now, moved=moved, newer=newer)
            return
        refusal = self._membership.refusal(reply, now)
        if refusal is not None:
            self._discard(refusal, reply, now)
            return
        joins = reply.sender_id != followed
        position = (reply.leader_id, reply.number + 1)
        forms_loop = self._position.forms_loop(*position, reply.leader_sequence, now)
        if forms_loop and (joins or position != self._position.in_group):
            self._discard("loop", reply, now)
        if forms_loop and joins:
            return
        newer = not forms_loop and self._position.is_newer(reply.leader_id, reply.leader_sequence)
        self._membership.receive_reply(reply, newer=newer, now=now)
        if NO_ID != reply.next_leader_id != self._position.own_id:
            self._adjacent_ids.receive_next_leader(reply.leader_id, reply.next_leader_id)
        if self._to_acknowledge:
            self._membership.join_soon(now)
        if joins and followed is not None:
            self._send_leave(followed, LeaveReason.FOLLOWS_ANOTHER)
        if not forms_loop:
            before = self._position.in_group
            if joins and position[0] != before[0]:
                self._forwarding.drop_others()
            self._move(
                position,
                reply.leader_sequence,
                GroupEvent.JOINED if joins else None,
                "answered",
                now,
            )
            self._announce(before, now)
            self._judge_again(now)

    def _leave(self, reason: LeaveReason, now: float) -> None:
        if self._membership.predecessor is not None:
            self._send_leave(self._membership.predecessor, reason)
        self._membership.leave(now)
        self._forwarding.drop_others()
        before = self._position.in_group
        self._position.become_first()
        event = GroupEvent.LEFT_LEADING if self._followers else GroupEvent.LEFT_ALONE
        self._apply_event(event, reason.name.lower(), now)
        self._announce(before, now)

    def _send_leave(self, to_id: CarId, reason: LeaveReason) -> None:
        self._outbox.append(Leave(*self._position.header, to_id, reason))

    def _move(
        self,
        position: tuple[CarId, int],
        leader_sequence: int,
        event: GroupEvent | None,
        cause: str,
        now: float,
    ) -> None:
        """Take a position as a member; without an `event` it may be a renumbering."""
        before = self._position.in_group
        self._position.take(*position, leader_sequence, now)
        if event is None and before != position:
            event = GroupEvent.RENUMBERED
        if event is not None:
            self._apply_event(event, cause, now)

    # Being followed

    def _receive_join(self, join: Join, now: float) -> None:
        is_for_us = join.to_id == self._position.own_id
        if is_for_us and join.sender_id not in self._followers:
            is_close = self._lead_monitor.shows_close(self._membership.predecessor)
            self._forwarding.add_recipient(join.sender_id, now, is_close=is_close)
        acknowledged = (join.acknowledged_origin_id, join.acknowledged_sequence)
        if acknowledged != _NO_EVENT and (is_for_us or join.leader_id == self._position.leader_id):
            behind = 1 if is_for_us else join.number - self._position.number
            self._forwarding.receive_acknowledgement(acknowledged, join.sender_id, behind, now)
        if not is_for_us:
            return
        if join.sender_id in (self._membership.predecessor, self._position.leader_id):
            self._discard("loop", join, now)
        elif self._followers.receive_join(join.sender_id, now):
            self._apply_event(GroupEvent.FOLLOWED, "join", now)
        self._to_answer.append(join)

    def _reply(self, join: Join, now: float) -> Reply:
        """Answer a join with the position at the time of sending, as an update before it has it."""
        return Reply(
            *self._position.header,
            to_id=join.sender_id,
            sequence=join.sequence,
            leader_sequence=self._position.next_leader_sequence(),
            speed_m_s=self._lead_monitor.speed_at(now),
            next_leader_id=self._adjacent_ids.next_of(self._position.leader_id),
        )

    def _receive_leave(self, leave: Leave, now: float) -> None:
        if leave.to_id == self._position.own_id and self._followers.remove(leave.sender_id):
            self._apply_event(GroupEvent.UNFOLLOWED, "leave", now)

    # Updates and warnings

    def _announce(self, before: tuple[CarId, int], now: float) -> None:
        """Send an update if the own position has changed and there are followers."""
        position = self._position
        is_renamed = before[1] == position.number and self._adjacent_ids.is_changing(now)
        if before != position.in_group and not is_renamed and self._followers:
            self._outbox.append(Update(*position.header, position.leader_sequence))

    def _receive_update(self, update: Update, now: float) -> None:
        """Follow the predecessor, and nobody else, to another position."""
        if not self._is_from_predecessor(update):
            return
        before, moved = self._position.in_group, (update.leader_id, update.number + 1)
        sequence = update.leader_sequence
        if moved == before:
            self._discard("up_to_date", update, now)
        elif self._position.forms_loop(*moved, sequence, now):
            self._discard("loop", update, now)
        else:
            if self._position.is_newer(update.leader_id, sequence):
                self._membership.receive_leader_sequence(now)
            self._move(moved, sequence, None, "update", now)
            self._announce(before, now)
            self._judge_again(now)

    def _receive_warn(self, warn: Warn, now: float) -> None:
        from_predecessor = self._is_from_predecessor(warn)
        distance = self._distance(warn)
        if warn.event_origin_id == self._position.own_id or self._own_braking.is_own(warn):
            refusal: str | None = "own_echo"
        elif self._forwarding.is_duplicate(warn, now):
            refusal = "duplicate"
            if from_predecessor:  # It repeats because the acknowledgement was lost.
                self._acknowledge(warn, distance, now)
            if from_predecessor or warn.leader_id == self._position.leader_id:
                self._forwarding.receive_duplicate(warn, distance, now)
        elif self._active_warnings.is_outdated(warn):
            refusal = "outdated"
            if from_predecessor:
                self._acknowledge(warn, distance, now)
        else:
            refusal = self._warn_refusal(warn)
            if refusal in _REFUSED_BY_GROUP:
                self._refused_warnings.receive_warn(warn, now)
        if refusal is not None:
            self._discard(refusal, warn, now)
            return
        self._accept(warn, now)
        self._forwarding.receive_first(warn, distance, now)
        self._forward_if_due(now)

    def _judge_again(self, now: float) -> None:
        """Accept those warnings of the group just joined that were received before."""
        for refused in self._refused_warnings.take(now):
            warn = self._adjacent_ids.translated(refused, now)
            if self._warn_refusal(warn) is None:
                self._accept(warn, now)
                self._forwarding.receive_late(warn, self._distance(warn), now)
            else:
                self._refused_warnings.receive_warn(warn, now)

    def _warn_refusal(self, warn: Warn) -> str | None:
        return warn_refusal(
            warn,
            self._state,
            self._position,
            from_predecessor=self._is_from_predecessor(warn),
            is_proved=self._proves_ids and warn.stated_at_s is not None,
            lifetime_s=self._parameters.event_lifetime_s,
        )

    def _distance(self, warn: Warn) -> int:
        """How many vehicles ahead the sender is."""
        return 1 if self._is_from_predecessor(warn) else self._position.number - warn.number

    def _accept(self, warn: Warn, now: float) -> None:
        car_id = self._adjacent_ids.present(warn.event_origin_id, now)
        self._events.extend(self._active_warnings.receive_warn(warn, car_id, self._position, now))
        self._acknowledge(warn, self._distance(warn), now)

    def _send_braking_if_due(self, now: float) -> None:
        braking = self._own_braking
        braking.end_test(now)
        if not braking.is_due(now):
            return
        sequence = self._next_event_sequence()
        warn = Warn(
            *self._position.header,
            event_origin_id=braking.origin_id,
            event_sequence=sequence,
            reach=self._reach.of_cause(braking.cause, now),
            origin_number=self._position.number,
            first_sequence=sequence if braking.first_sequence is None else braking.first_sequence,
            cause=braking.cause,
            deceleration_m_s2=braking.deceleration_m_s2,
            age_s=braking.age_s(now),
            hops=1,
        )
        braking.sent(sequence, now)
        if self._state is not GroupState.REGULAR:
            self._outbox.append(warn)
        self._forwarding.originate(warn, now)

    def _acknowledge(self, warn: Warn, distance: int, now: float) -> None:
        """Name the warning in the next join, and advance that join."""
        if event_of(warn) not in self._to_acknowledge:
            self._to_acknowledge.append(event_of(warn))
        if self._forwarding.is_last_forwarder(warn, distance):
            self._membership.join_at_once(now)
            self._join_if_due(now)
        else:
            self._membership.join_soon(now)

    def _forward_if_due(self, now: float) -> None:
        due_at = self._forwarding.get_timer()
        if now < due_at:
            return
        is_member = self._state is GroupState.MEMBER
        self._outbox += self._forwarding.copies_to_send(is_member=is_member, now=now)

    def _is_from_predecessor(self, message: GroupMessage) -> bool:
        return message.sender_id == self._membership.predecessor

    def _next_event_sequence(self) -> int:
        self._event_sequence = (self._event_sequence + 1) % _SEQUENCES
        return self._event_sequence

    def _apply_event(self, event: GroupEvent, cause: str, now: float) -> None:
        before, self._state = self._state, next_state(self._state, event)
        self._events.append(
            Transition(
                stamp_s=now,
                event=event,
                state_before=before,
                state=self._state,
                leader_id=self._position.leader_id,
                group_number=self._position.number,
                cause=cause,
            )
        )

    def _discard(self, reason: str, message: GroupMessage, now: float) -> None:
        detail = f"{message.kind} from {message.sender_id.hex()}"
        self._events.append(Discarded(now, "lcca", reason, detail))
