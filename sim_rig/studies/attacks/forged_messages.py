"""Insiders who forge messages of a group under IDs that they prove, or may have proved.

One class for each kind of message that others do not forge, and for each way to make others doubt,
drop or delay what a braking vehicle has signed.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

from typing_extensions import override

from onboard.messages.lcca import (
    NO_ID,
    Answer,
    CarId,
    Inquiry,
    Join,
    LccaMessage,
    Reply,
    Warn,
    WarnCause,
)
from onboard.vehicle.lcca_link import MAX_STATEMENTS
from sim_rig.studies.attacks.attack_world import SPEED_M_S, STEP_S
from sim_rig.studies.attacks.attacked_group import (
    BADLY_READ,
    FOLLOWERS,
    LEADER,
    NOT_READ,
)
from sim_rig.studies.attacks.group_attacks import BRAKING_MESSAGES, PERIOD_MESSAGES
from sim_rig.studies.attacks.impostures import Imposture, braking

EPOCH_S = 300.0
"""From one ID of a vehicle to the next."""


class ForgedJoins(Imposture):
    """Joins behind the first follower, and acknowledges at once what others have yet to receive.

    The leader takes it for a vehicle in its reach, so all wait for it to repeat a warning.
    """

    reach: ClassVar[int] = 1

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Stay a follower."""
        yield self._join(self.insider.own_id(now), NO_ID, 0, now)

    @override
    def answers(self, message: LccaMessage, _secured: bytes, now: float) -> Iterator[bytes]:
        """Acknowledge each warning of the leader, in its own name and in the last vehicle's."""
        if isinstance(message, Warn) and message.is_direct:
            for joins in (self.insider.own_id(now), self.plates.car_id(FOLLOWERS[-1], now)):
                yield self._join(joins, message.event_origin_id, message.event_sequence, now)

    def _join(self, joins: CarId, origin: CarId, number: int, now: float) -> bytes:
        lead, joined = (self.plates.car_id(plate, now) for plate in (LEADER, FOLLOWERS[0]))
        sequence = round(now / STEP_S) % (1 << 16)
        return self.insider.signed(Join(joins, lead, 3, joined, sequence, origin, number), now)


class ForgedReplies(Imposture):
    """Answers each join for the vehicle that was to answer, and names the follower as next."""

    @override
    def answers(self, message: LccaMessage, _secured: bytes, now: float) -> Iterator[bytes]:
        """Answer before that vehicle does."""
        if isinstance(message, Join):
            own, follower = self.insider.own_id(now), message.sender_id
            yield self.insider.signed(
                Reply(own, own, 1, follower, message.sequence, 9, SPEED_M_S, follower), now
            )


class NextLeader(Imposture):
    """Drives ahead of the group, leads it, and names its members as its own next ID."""

    leads: ClassVar[bool] = True

    @override
    def answers(self, message: LccaMessage, _secured: bytes, now: float) -> Iterator[bytes]:
        """Answer who asks for it, and who joins it."""
        own, asks = self.insider.own_id(now), message.sender_id
        if isinstance(message, Inquiry):
            evil = self.insider.temporary_id
            answer = Answer(own, asks, message.sequence, evil, SPEED_M_S)
            yield self.insider.signed(answer, now)
        elif isinstance(message, Join) and message.to_id == own:
            member = self.plates.car_id(FOLLOWERS[0], now)
            reply = Reply(own, own, 1, asks, message.sequence, 1, SPEED_M_S, member)
            yield self.insider.signed(self.insider.masked(reply, now), now)


class Mimicry(Imposture):
    """Sends BSMs with the leader's place and speed, and answers for those places.

    Cameras read plates badly. Where they read them well, no motion weighs against them.
    """

    plate: ClassVar[float] = BADLY_READ

    @property
    def temporary_id(self) -> bytes:
        """Of its BSMs."""
        return self.insider.temporary_id

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Send a BSM from where the leader is."""
        place_m = 0.0, self.group.way_m
        velocity_m_s = 0.0, self.group.speed_m_s
        yield self.insider.bsm_at(place_m, velocity_m_s, now, temporary_id=self.temporary_id)

    @override
    def answers(self, message: LccaMessage, _secured: bytes, now: float) -> Iterator[bytes]:
        """Answer under its own ID, which it proves."""
        if isinstance(message, Inquiry):
            own, speed_m_s = self.insider.own_id(now), self.group.speed_m_s
            asked = message.sender_id, message.sequence
            yield self.insider.signed(Answer(own, *asked, self.temporary_id, speed_m_s), now)


class ForgedAnswers(Mimicry):
    """The same under the leader's temporary ID."""

    @property
    @override
    def temporary_id(self) -> bytes:
        """Of the leader's BSMs."""
        return self.group.temporary_id


class MimicryUnread(Mimicry):
    """The same where no camera reads a plate."""

    plate: ClassVar[float] = NOT_READ


class SilentMimicry(Mimicry):
    """Sends these BSMs and answers nobody."""

    @override
    def answers(self, message: LccaMessage, _secured: bytes, now: float) -> Iterator[bytes]:
        """Answer nothing."""
        yield from ()


class BadlyRead(Imposture):
    """No attack, where cameras read plates badly."""

    plate: ClassVar[float] = BADLY_READ


class Unread(Imposture):
    """No attack, where no camera reads a plate."""

    plate: ClassVar[float] = NOT_READ


class OtherEpochs(Imposture):
    """Brakes under one ID of its vehicle after the other, of epochs that are not this one."""

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Invent a braking under the ID whose turn it is."""
        number, into = divmod(round(now / STEP_S), PERIOD_MESSAGES // 4)
        if into < BRAKING_MESSAGES // 4:
            later_s = EPOCH_S * (2 + number % 100)
            own = self.insider.own_id(now + later_s)
            lead = self.plates.car_id(LEADER, now)
            warn = replace(braking(own, lead, number), event_origin_id=own)
            yield self.insider.signed(warn, now, proved_at=now + later_s)


class ForgedTests(Imposture):
    """Tests a brake button without end."""

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Send a test of its own as a member ahead."""
        own, lead = self.insider.own_id(now), self.plates.car_id(LEADER, now)
        test = replace(braking(own, lead, round(now / STEP_S)), cause=WarnCause.TEST)
        yield self.insider.signed(replace(test, event_origin_id=own), now)


class StatementFlood(Imposture):
    """States many brakings of its own vehicle at each of the leader, before that is passed on."""

    reach: ClassVar[int] = 1

    @override
    def answers(self, message: LccaMessage, _secured: bytes, now: float) -> Iterator[bytes]:
        """State as many as a vehicle keeps."""
        if isinstance(message, Warn) and message.is_direct:
            own = self.insider.own_id(now)
            for number in range(MAX_STATEMENTS):
                yield self.insider.signed(braking(own, own, number), now)
