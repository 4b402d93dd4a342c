"""The hard brakings of one warning group: what this vehicle accepts, sends, repeats, acknowledges.

`own_braking` is the own state, `active_warnings` that of the vehicles ahead; `acceptance` tells
which warnings are accepted, and `forwarding` which ones are repeated. Where the vehicle is in its
group is not decided here.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from onboard.lcca.acceptance import warn_refusal
from onboard.lcca.active_warnings import ActiveWarnings
from onboard.lcca.adjacent_ids import AdjacentIds
from onboard.lcca.events import WarningLevel, WarningOver, WarningRaised, discarded
from onboard.lcca.followers import Followers
from onboard.lcca.forwarding import Forwarding, Reach, event_of
from onboard.lcca.group_position import GroupPosition
from onboard.lcca.membership import Membership
from onboard.lcca.own_braking import OwnBraking
from onboard.lcca.parameters import GroupParameters
from onboard.lcca.refused_warnings import RefusedWarnings
from onboard.lcca.transitions import GroupState
from onboard.messages.lcca import NO_ID, CarId, GroupMessage, Join, Warn, WarnCause
from onboard.observations import Discarded, HardBrake

WarningEvents = WarningRaised | WarningLevel | WarningOver | Discarded

_SEQUENCES = 1 << 16
_REFUSED_BY_GROUP = ("not_in_group", "other_group")
"""Reasons that end when the vehicle joins that group."""


class GroupWarnings:
    """The brakings of this vehicle and of those ahead in its group."""

    def __init__(
        self,
        parameters: GroupParameters,
        position: GroupPosition,
        membership: Membership,
        followers: Followers,
        adjacent_ids: AdjacentIds,
        *,
        rng: np.random.Generator,
        proves_ids: bool,
    ) -> None:
        """Start without warnings.

        Args:
            parameters: times and limits of the warning group.
            position: of this vehicle in its group.
            membership: sends the acknowledgements.
            followers: those of this vehicle.
            adjacent_ids: names the vehicles of warnings under IDs of other epochs.
            rng: for start values of sequence numbers and random delays.
            proves_ids: whether certificates name the IDs of their vehicles.
        """
        self._parameters = parameters
        self._position = position
        self._membership = membership
        self._followers = followers
        self._adjacent_ids = adjacent_ids
        self._rng = rng
        self._proves_ids = proves_ids
        self._reach = Reach(parameters, proves_ids=proves_ids)
        self._forwarding = Forwarding(parameters, position, followers, self._reach, rng)
        self._own_braking = OwnBraking(parameters, rng)
        self._active = ActiveWarnings(parameters)
        self._refused = RefusedWarnings(parameters.event_lifetime_s)
        self._event_sequence = int(rng.integers(_SEQUENCES))

    def receive_hard_brake(self, brake: HardBrake, now: float) -> None:
        """Take a change of the own hard braking."""
        self._own_braking.receive_hard_brake(brake, self._position.own_id, now)

    def receive_header(self, message: GroupMessage, now: float) -> None:
        """Take the place of any message's sender: those behind are within reach."""
        behind = message.number - self._position.number
        if behind > 0 and message.leader_id == self._position.leader_id:
            self._reach.receive_distance(message.sender_id, behind, now)

    def receive_bsm(self, car_id: CarId, now: float) -> None:
        """Take that a BSM of this vehicle has arrived."""
        self._reach.receive_bsm(car_id, now)

    def receive_join(self, join: Join, now: float, *, is_close: bool) -> None:
        """Take a join, to whomever, for the warning that it acknowledges.

        A new follower gets the warnings of brakings that last.

        Args:
            join: the join; its sender is not added to the followers yet.
            now: seconds on the cores' clock.
            is_close: whether the camera shows the predecessor as close.
        """
        is_for_us = join.to_id == self._position.own_id
        if is_for_us and join.sender_id not in self._followers:
            self._forwarding.add_recipient(join.sender_id, now, is_close=is_close)
        is_of_group = is_for_us or join.leader_id == self._position.leader_id
        if is_of_group and join.acknowledged_origin_id != NO_ID:
            acknowledged = join.acknowledged_origin_id, join.acknowledged_sequence
            behind = 1 if is_for_us else join.number - self._position.number
            self._forwarding.receive_acknowledgement(acknowledged, join.sender_id, behind, now)

    def receive_warn(self, warn: Warn, state: GroupState, now: float) -> Iterator[WarningEvents]:
        """Take a warning from the radio; yields what it changes, or why it is discarded."""
        refusal = self._refusal(warn, state, now)
        if refusal is not None:
            yield discarded(refusal, warn, now)
            return
        yield from self._accept(warn, now)
        self._forwarding.receive_first(warn, self._distance(warn), now)

    def _refusal(self, warn: Warn, state: GroupState, now: float) -> str | None:
        """Return why a warning is discarded; take of it what it tells nonetheless."""
        from_predecessor = self._membership.follows(warn.sender_id)
        if warn.event_origin_id == self._position.own_id or self._own_braking.is_own(warn):
            return "own_echo"
        if self._forwarding.is_duplicate(warn, now):
            if from_predecessor:  # It repeats because the acknowledgement was lost.
                self._acknowledge(warn, now)
            if from_predecessor or warn.leader_id == self._position.leader_id:
                self._forwarding.receive_duplicate(warn, self._distance(warn), now)
            return "duplicate"
        if self._active.is_outdated(warn):
            if from_predecessor:
                self._acknowledge(warn, now)
            return "outdated"
        refusal = self._acceptance(warn, state)
        if refusal in _REFUSED_BY_GROUP:
            self._refused.receive_warn(warn, now)
        return refusal

    def judge_again(self, state: GroupState, now: float) -> Iterator[WarningEvents]:
        """Accept those warnings of the group just joined that were received before.

        Ends come first: what a vehicle has repeated of a braking that is over is outdated.
        """
        for refused in sorted(self._refused.take(now), key=_is_of_braking):
            warn = self._adjacent_ids.translated(refused, now)
            if self._acceptance(warn, state) is not None:
                self._refused.receive_warn(warn, now)
            elif not self._active.is_outdated(warn):
                yield from self._accept(warn, now)
                self._forwarding.receive_late(warn, self._distance(warn), now)

    def _acceptance(self, warn: Warn, state: GroupState) -> str | None:
        return warn_refusal(
            warn,
            state,
            self._position,
            from_predecessor=self._membership.follows(warn.sender_id),
            is_proved=self._proves_ids and warn.stated_at_s is not None,
            lifetime_s=self._parameters.event_lifetime_s,
        )

    def _accept(self, warn: Warn, now: float) -> Iterator[WarningEvents]:
        car_id = self._adjacent_ids.present(warn.event_origin_id, now)
        yield from self._active.receive_warn(warn, car_id, self._position, now)
        self._acknowledge(warn, now)

    def _acknowledge(self, warn: Warn, now: float) -> None:
        is_last = self._forwarding.is_last_forwarder(warn, self._distance(warn))
        self._membership.acknowledge([event_of(warn)], now, at_once=is_last)

    def _distance(self, warn: Warn) -> int:
        """How many vehicles ahead the sender is."""
        if self._membership.follows(warn.sender_id):
            return 1
        return self._position.number - warn.number

    def rename(self, names: Mapping[CarId, CarId]) -> None:
        """Take the new IDs of vehicles, by the old ones."""
        self._active.rename(names)

    def change_epoch(self, now: float) -> None:
        """Take the own ID of a new epoch, which `position` has already.

        Event sequence numbers begin anew, and a braking that lasts has a new name, so that they do
        not link the IDs. The predecessor takes this vehicle for another follower, and gets at once
        what was received.
        """
        self._event_sequence = int(self._rng.integers(_SEQUENCES))
        self._forwarding.change_epoch(now)
        self._own_braking.rename(self._position.own_id, now)
        self._membership.acknowledge(map(event_of, self._active.warnings), now)

    def leave_group(self) -> None:
        """Repeat no more what the vehicles of this group have started."""
        self._forwarding.drop_others()

    def warns_to_send(self, state: GroupState, now: float) -> list[Warn]:
        """Return the warning of the own braking, and the copies of others, that are due."""
        own = self._own_warn(now)
        is_member = state is GroupState.MEMBER
        copies = []
        if now >= self._forwarding.get_timer():
            copies = self._forwarding.copies_to_send(is_member=is_member, now=now)
        return copies if own is None or state is GroupState.REGULAR else [own, *copies]

    def _own_warn(self, now: float) -> Warn | None:
        braking = self._own_braking
        braking.end_test(now)
        if not braking.is_due(now):
            return None
        self._event_sequence = sequence = (self._event_sequence + 1) % _SEQUENCES
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
        self._forwarding.originate(warn, now)
        return warn

    def expire(self, now: float) -> Iterator[WarningOver]:
        """End the brakings ahead of which nothing arrives any more."""
        return self._active.expire(now)

    def get_timer(self) -> float:
        """When a warning is to be sent, or a braking ahead ends; infinite without either."""
        return min(
            self._forwarding.get_timer(), self._own_braking.get_timer(), self._active.get_timer()
        )


def _is_of_braking(warn: Warn) -> bool:
    return warn.cause is not WarnCause.OVER
