"""One vehicle's part in its warning group (LCCA, section 3): the core without I/O.

It puts the parts together: `lead_monitor` tells whether to join the lead, `membership` sends joins,
`group_position` holds leader and number, `followers` who follows, `group_warnings` the brakings,
and `transitions` alone decides the state in the group. docs/design/lcca.md states what the paper
leaves open.
"""

from collections import deque

import numpy as np
from typing_extensions import override

from onboard.core import Core
from onboard.lcca.adjacent_ids import AdjacentIds, Renamed
from onboard.lcca.events import MeasuredLead, Transition, discarded
from onboard.lcca.followers import Followers
from onboard.lcca.group_position import LARGEST_ADVANCE, GroupPosition
from onboard.lcca.group_warnings import GroupWarnings, WarningEvents
from onboard.lcca.lead_monitor import LeadMonitor
from onboard.lcca.membership import Membership
from onboard.lcca.parameters import GroupParameters
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
from onboard.observations import HardBrake

__all__ = ["MeasuredLead", "WarningGroup"]

GroupEvents = Transition | WarningEvents

_SEQUENCES = 1 << 16


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
        self._rng = rng
        self._adjacent_ids = AdjacentIds(parameters.id_change_s)
        self._state = GroupState.REGULAR
        self._position = GroupPosition(own_id, int(rng.integers(_SEQUENCES)))
        self._lead_monitor = LeadMonitor(parameters)
        self._membership = Membership(parameters, self._lead_monitor, rng)
        self._followers = Followers(parameters)
        self._warnings = GroupWarnings(
            parameters,
            self._position,
            self._membership,
            self._followers,
            self._adjacent_ids,
            rng=rng,
            proves_ids=proves_ids,
        )
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
        self._warnings.receive_hard_brake(brake, now)
        self._send_warns_if_due(now)

    def has_ahead(self, warn: Warn, now: float) -> bool:
        """Whether a vehicle that sent this warning itself so states to be ahead in this group."""
        own = self._adjacent_ids.translated(warn, now)
        if self._membership.follows(own.sender_id):
            return True
        return own.leader_id == self.leader_id and own.number < self.group_number

    def receive_next_own_id(self, next_id: CarId) -> None:
        """Take the own ID of the next epoch: others may use it before this vehicle does."""
        self._adjacent_ids.receive_next(self._position.own_id, next_id)

    def set_own_id(self, car_id: CarId, now: float) -> None:
        """Take the own ID of a new epoch; all vehicles change theirs at about this time.

        Sequence numbers begin anew, so that they do not link the IDs.
        """
        self._rename(self._adjacent_ids.change_epoch(self._position.own_id, car_id, now))
        self._position.advance(int(self._rng.integers(1, LARGEST_ADVANCE)))
        self._membership.change_sequence()
        self._warnings.change_epoch(now)

    def _rename(self, names: Renamed) -> None:
        self._position.rename(names.leaders)
        self._lead_monitor.rename(names.cars)
        self._membership.rename(names.cars)
        self._warnings.rename(names.cars)

    def receive_message(self, message: GroupMessage, now: float) -> None:
        """Take a message from the radio, to whichever vehicle it is addressed."""
        message = self._adjacent_ids.translated(message, now)
        if message.sender_id == self._position.own_id:
            self._discard("own_echo", message, now)
            return
        self._warnings.receive_header(message, now)
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

    def receive_bsm(self, car_id: CarId, now: float, speed_m_s: float | None = None) -> None:
        """Take that a BSM of this vehicle has arrived: it is still there, and within reach."""
        car_id = self._adjacent_ids.present(car_id, now)
        self._lead_monitor.receive_speed_on_air(car_id, speed_m_s, now)
        self._membership.receive_bsm(car_id, now)
        self._warnings.receive_bsm(car_id, now)
        if self._followers.receive_bsm(car_id, now):
            self._apply_event(GroupEvent.UNFOLLOWED, "expired", now)

    def messages_to_send(self, now: float) -> list[GroupMessage]:
        """Return the messages to send, the most urgent first, and clear the outbox."""
        if not self._to_answer and not self._outbox:
            return []
        replies = [self._reply(join, now) for join in self._to_answer]
        out = sorted([*self._outbox, *replies], key=lambda message: -message.user_priority)
        self._to_answer.clear()
        self._outbox.clear()
        return out

    @override
    def get_timer(self) -> float:
        """When `handle_timer` is due; infinite if nothing is planned."""
        return min(
            self._membership.get_timer(), self._followers.get_timer(), self._warnings.get_timer()
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
        self._events.extend(self._warnings.expire(now))
        self._send_warns_if_due(now)

    @override
    def next_event(self) -> GroupEvents | None:
        """Return the oldest event not yet taken, or `None`."""
        return self._events.popleft() if self._events else None

    # Following the predecessor

    def _join_if_due(self, now: float) -> None:
        join = self._membership.next_join(self._position.header, now)
        if join is not None:
            self._outbox.append(join)

    def _receive_reply(self, reply: Reply, now: float) -> None:
        position, followed = self._position, self._membership.predecessor
        newer = position.is_newer(reply.leader_id, reply.leader_sequence)
        if reply.to_id != position.own_id:
            if reply.to_id == followed:
                moved = (reply.leader_id, reply.number + 2) != position.in_group
                self._membership.receive_predecessor_reply(now, moved=moved, newer=newer)
            return
        taken = (reply.leader_id, reply.number + 1, reply.leader_sequence)
        refusal = self._membership.refusal(reply, now)
        if refusal is None and position.forms_loop(*taken):
            refusal = "loop"
        if refusal is not None:
            self._discard(refusal, reply, now)
            return
        self._membership.receive_reply(reply, newer=newer, now=now)
        self._lead_monitor.receive_speed_on_air(reply.sender_id, reply.speed_m_s, now)
        if NO_ID != reply.next_leader_id != position.own_id:
            self._adjacent_ids.receive_next_leader(reply.leader_id, reply.next_leader_id)
        joins = reply.sender_id != followed
        if joins and followed is not None:
            self._send_leave(followed, LeaveReason.FOLLOWS_ANOTHER)
        if joins and reply.leader_id != position.leader_id:
            self._warnings.leave_group()
        self._move(*taken, now, event=GroupEvent.JOINED if joins else None, cause="answered")

    def _leave(self, reason: LeaveReason, now: float) -> None:
        if self._membership.predecessor is not None:
            self._send_leave(self._membership.predecessor, reason)
        self._membership.leave(now)
        self._warnings.leave_group()
        before = self._position.in_group
        self._position.become_first()
        event = GroupEvent.LEFT_LEADING if self._followers else GroupEvent.LEFT_ALONE
        self._apply_event(event, reason.name.lower(), now)
        self._announce(before, now)

    def _send_leave(self, to_id: CarId, reason: LeaveReason) -> None:
        self._outbox.append(Leave(*self._position.header, to_id, reason))

    def _move(
        self,
        leader_id: CarId,
        number: int,
        leader_sequence: int,
        now: float,
        *,
        event: GroupEvent | None,
        cause: str,
    ) -> None:
        """Take a position as a member; without an `event` it may be a renumbering."""
        before = self._position.in_group
        self._position.take(leader_id, number, leader_sequence)
        if event is None and before != self._position.in_group:
            event = GroupEvent.RENUMBERED
        if event is not None:
            self._apply_event(event, cause, now)
        self._announce(before, now)
        self._events.extend(self._warnings.judge_again(self._state, now))
        self._join_if_due(now)

    # Being followed

    def _receive_join(self, join: Join, now: float) -> None:
        is_for_us = join.to_id == self._position.own_id
        is_close = self._lead_monitor.shows_close(self._membership.predecessor)
        self._warnings.receive_join(join, now, is_close=is_close)
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
        if not self._membership.follows(update.sender_id):
            return
        moved = (update.leader_id, update.number + 1, update.leader_sequence)
        if moved[:2] == self._position.in_group:
            self._discard("up_to_date", update, now)
        elif self._position.forms_loop(*moved):
            self._discard("loop", update, now)
        else:
            if self._position.is_newer(update.leader_id, update.leader_sequence):
                self._membership.receive_leader_sequence(now)
            self._move(*moved, now, event=None, cause="update")

    def _receive_warn(self, warn: Warn, now: float) -> None:
        self._events.extend(self._warnings.receive_warn(warn, self._state, now))
        self._join_if_due(now)
        self._send_warns_if_due(now)

    def _send_warns_if_due(self, now: float) -> None:
        self._outbox += self._warnings.warns_to_send(self._state, now)

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
        self._events.append(discarded(reason, message, now))
