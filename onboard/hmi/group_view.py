"""The members of the own group and the group messages, as heard on the radio: the page's core.

Joins and replies tell leader and number of every member in range twice a second. What a vehicle
told last is shown with its age, and forgotten after `MEMBER_S`. Repetitions of a message share one
row, so that a warning is not lost among them. The fields of a message are those that
`messages/lcca.py` declares.
"""

import math
from collections import OrderedDict
from dataclasses import dataclass

from onboard.hmi.driver_view import MemberView, MessageView, Relation, short_id
from onboard.lcca.group import WarningGroup
from onboard.lcca.transitions import GroupState
from onboard.messages.exchanged import MessageReceived, MessageSent
from onboard.messages.lcca import MESSAGES
from onboard.observations import HardBrake
from onboard.trace.trace_line import Event

MEMBER_S = 3.0
"""Silence after which a member is no longer shown: members send joins every half second."""
BRAKES_S = 3.0
"""How long a vehicle is shown as braking after the last warning of it, unless its end is told."""
MOST_VEHICLES = 256
"""Vehicles that are remembered; of more, those heard the longest time ago are forgotten."""
MOST_MEMBERS = 16
"""Members that are shown: the nearest in the group."""
MOST_MESSAGES = 20
"""Messages that are shown: the most urgent by their user priority, and of these the latest."""
MESSAGE_S = 30.0
"""Age after which a message is no longer shown."""

_USER_PRIORITIES: dict[str, int] = {
    each.record.kind: each.record.user_priority for each in MESSAGES.values()
}
"""By kind of message."""
_ADDRESSES = frozenset({"sender_id", "leader_id", "number", "to_id"})
"""Fields with a place of their own in a `MessageView`."""
_INTERNAL = ("_id", "sequence", "reach")
"""Ends of the names of fields that tell a person nothing."""


@dataclass(slots=True)
class _LastReport:
    """What the last message of or about a vehicle said."""

    leader_id: str
    number: int
    at_s: float
    brakes_until_s: float = -math.inf


class GroupView:
    """Collects what the page shows of the group."""

    def __init__(self) -> None:
        """Start without any message."""
        self._own_id: str | None = None
        self._vehicles: OrderedDict[str, _LastReport] = OrderedDict()
        """By communication ID, the one heard the longest time ago first."""
        self._host_brakes_until_s = -math.inf
        self._messages: dict[tuple[object, ...], MessageView] = {}
        """By what repetitions have in common, in the order of the first one."""

    def receive_event(self, event: Event) -> None:
        """Take an event of the stack."""
        match event:
            case MessageReceived() if event.message in _USER_PRIORITIES:
                self._receive_message(event)
            case MessageSent() if event.message in _USER_PRIORITIES:
                self._own_id = str(event.content["sender_id"])
            case HardBrake():
                self._host_brakes_until_s = -math.inf if event.is_over else event.stamp_s + BRAKES_S

    def members(self, group: WarningGroup, now: float) -> tuple[MemberView, ...]:
        """Return the host vehicle and the members heard lately, in the order of their numbers.

        A follower is among them before it tells the own leader.

        Args:
            group: of the host vehicle.
            now: present time in s.
        """
        relations = {each.hex(): Relation.FOLLOWER for each in group.followers}
        if group.predecessor_id is not None:
            relations[group.predecessor_id.hex()] = Relation.PREDECESSOR
        leader_id, own_number = group.leader_id.hex(), group.group_number
        others = [
            MemberView(
                car=short_id(car_id),
                number=last.number,
                state=_state(last, is_leader=car_id == leader_id),
                relation=relations.get(car_id, Relation.OTHER),
                received_at_s=last.at_s,
                brakes=now < last.brakes_until_s,
            )
            for car_id, last in self._vehicles.items()
            if now - last.at_s <= MEMBER_S
            and car_id != self._own_id
            and (last.leader_id == leader_id or relations.get(car_id) is Relation.FOLLOWER)
        ]
        others.sort(key=lambda each: abs(each.number - own_number))
        host = MemberView(
            car=None if self._own_id is None else short_id(self._own_id),
            number=own_number,
            state=group.state,
            relation=Relation.HOST,
            received_at_s=now,
            brakes=now < self._host_brakes_until_s,
        )
        return tuple(sorted([host, *others[:MOST_MEMBERS]], key=lambda each: each.number))

    def messages(self, now: float) -> tuple[MessageView, ...]:
        """Return the messages heard lately, the one that came up last first.

        Args:
            now: present time in s.
        """
        return tuple(
            each
            for each in reversed(self._messages.values())
            if now - each.received_at_s <= MESSAGE_S
        )

    def _receive_message(self, event: MessageReceived) -> None:
        content, now = event.content, event.stamp_s
        self._list_message(event)
        sender_id, leader_id, number = (
            content.get(name) for name in ("sender_id", "leader_id", "number")
        )
        if event.message == "leave":
            self._vehicles.pop(str(sender_id), None)
        elif isinstance(leader_id, str) and isinstance(number, int):
            self._note(str(sender_id), leader_id, number, now)
            origin_number = content.get("origin_number")
            if isinstance(origin_number, int):
                origin_id = str(content["event_origin_id"])
                origin = self._note(origin_id, leader_id, origin_number, now)
                is_over = content.get("cause") == "over"
                origin.brakes_until_s = -math.inf if is_over else now + BRAKES_S

    def _list_message(self, event: MessageReceived) -> None:
        content, now = event.content, event.stamp_s
        to_id, leader_id, number = (content.get(name) for name in ("to_id", "leader_id", "number"))
        repeated = ("sender_id", "to_id", "event_origin_id")
        self._messages[event.message, *map(content.get, repeated)] = MessageView(
            received_at_s=now,
            message=event.message,
            sender=short_id(str(content["sender_id"])),
            receiver=None if to_id is None else short_id(str(to_id)),
            is_to_host=to_id is not None and to_id == self._own_id,
            leader=None if leader_id is None else short_id(str(leader_id)),
            number=number if isinstance(number, int) else None,
            content={
                name: value
                for name, value in content.items()
                if name not in _ADDRESSES and not name.endswith(_INTERNAL)
            },
        )
        if len(self._messages) > MOST_MESSAGES:
            del self._messages[min(self._messages, key=lambda key: self._value(key, now))]

    def _value(self, key: tuple[object, ...], now: float) -> tuple[bool, int, float]:
        """Return what decides which message is dropped, the least first."""
        each = self._messages[key]
        is_shown = now - each.received_at_s <= MESSAGE_S
        return is_shown, _USER_PRIORITIES[each.message], each.received_at_s

    def _note(self, car_id: str, leader_id: str, number: int, now: float) -> _LastReport:
        """Store leader and number of a vehicle."""
        last = self._vehicles.setdefault(car_id, _LastReport(leader_id, number, now))
        last.leader_id, last.number, last.at_s = leader_id, number, now
        self._vehicles.move_to_end(car_id)
        if len(self._vehicles) > MOST_VEHICLES:
            self._vehicles.popitem(last=False)
        return last


def _state(last: _LastReport, *, is_leader: bool) -> GroupState:
    if last.number > 1:
        return GroupState.MEMBER
    return GroupState.LEADER if is_leader else GroupState.REGULAR
