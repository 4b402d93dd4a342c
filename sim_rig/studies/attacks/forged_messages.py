"""Insiders who forge messages of a group under IDs that they prove, or may have proved.

One class for each kind of message that others do not forge, and for each way to make others doubt,
drop or delay what a braking vehicle has signed.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

from typing_extensions import override

from onboard.messages.lcca import (
    Answer,
    Inquiry,
    Join,
    LccaMessage,
    Leave,
    LeaveReason,
    Reply,
    Update,
    Warn,
    WarnCause,
)
from sim_rig.studies.attacks.attack_world import SPEED_M_S, STEP_S
from sim_rig.studies.attacks.attacked_group import (
    BADLY_READ,
    FOLLOWERS,
    LEADER,
    NOT_READ,
    PLATES,
    AttackedGroup,
)
from sim_rig.studies.attacks.group_attacks import BRAKING_MESSAGES, PERIOD_MESSAGES, GroupInsider
from sim_rig.studies.attacks.impostures import Imposture, Plates, braking

EPOCH_S = 300.0
"""From one ID of a vehicle to the next."""
FLOOD_MESSAGES = 10
"""Statements of one insider in `STEP_S`: 100 a second."""


class ForgedJoins(Imposture):
    """Joins each vehicle, and acknowledges what the leader will send next."""

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Join all of them."""
        own, lead = self.insider.own_id(now), self.plates.car_id(LEADER, now)
        sequence = round(now / STEP_S) % (1 << 16)
        for number, plate in enumerate(PLATES, start=1):
            joined = self.plates.car_id(plate, now)
            newest = (self.group.newest + 1) % (1 << 16)
            join = Join(own, lead, number + 1, joined, sequence, lead, newest)
            yield self.insider.signed(join, now)


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


class ForgedLeaves(Imposture):
    """Leaves each vehicle, in the own name."""

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Leave all of them."""
        own, lead = self.insider.own_id(now), self.plates.car_id(LEADER, now)
        for plate in PLATES:
            left = self.plates.car_id(plate, now)
            yield self.insider.signed(Leave(own, lead, 2, left, LeaveReason.GAP), now)


class ForgedUpdates(Imposture):
    """Tells the group that the insider leads it now."""

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Send an update in the own name, which nobody follows."""
        own, sequence = self.insider.own_id(now), round(now / STEP_S) % (1 << 16)
        yield self.insider.signed(Update(own, own, 1, sequence), now)


class ForgedAnswers(Imposture):
    """Answers each inquiry under its own ID, with its temporary ID and that of the leader."""

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Send a BSM from beside the group."""
        yield self.insider.bsm_at((4.0, self.group.way_m), (0.0, self.group.speed_m_s), now)

    @override
    def answers(self, message: LccaMessage, _secured: bytes, now: float) -> Iterator[bytes]:
        """Answer before others do."""
        if isinstance(message, Inquiry):
            own = self.insider.own_id(now)
            for temporary_id in (self.insider.temporary_id, self.group.temporary_id):
                answer = Answer(own, message.sender_id, message.sequence, temporary_id, SPEED_M_S)
                yield self.insider.signed(answer, now)


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
    """Sends BSMs with the leader's place and speed, and answers for those places."""

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Send a BSM from where the leader is."""
        place_m = 0.0, self.group.way_m
        yield self.insider.bsm_at(place_m, (0.0, self.group.speed_m_s), now)

    @override
    def answers(self, message: LccaMessage, _secured: bytes, now: float) -> Iterator[bytes]:
        """Answer under its own ID, which it proves."""
        if isinstance(message, Inquiry):
            own, speed_m_s = self.insider.own_id(now), self.group.speed_m_s
            evil = self.insider.temporary_id
            answer = Answer(own, message.sender_id, message.sequence, evil, speed_m_s)
            yield self.insider.signed(answer, now)


class MimicryBadlyRead(Mimicry):
    """The same where cameras read plates badly."""

    plate: ClassVar[float] = BADLY_READ


class MimicryUnread(Mimicry):
    """The same where no camera reads a plate."""

    plate: ClassVar[float] = NOT_READ


class SilentMimicry(Mimicry):
    """Sends these BSMs and answers nobody, where cameras read plates badly."""

    plate: ClassVar[float] = BADLY_READ

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


class Replay(Imposture):
    """Passes on each warning of the leader again and again, as fresh ones."""

    reach: ClassVar[int] = 1

    def __init__(self, insider: GroupInsider, group: AttackedGroup, plates: Plates) -> None:
        super().__init__(insider, group, plates)
        self._received: list[tuple[Warn, bytes]] = []

    @override
    def answers(self, message: LccaMessage, secured: bytes, _now: float) -> Iterator[bytes]:
        """Keep what the leader signs."""
        if isinstance(message, Warn) and message.is_direct:
            self._received = [*self._received[-9:], (message, secured)]
        yield from ()

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Pass on the last ten."""
        own, lead = self.insider.own_id(now), self.plates.car_id(LEADER, now)
        for warn, secured in self._received:
            copy = replace(warn, sender_id=own, leader_id=lead, hops=2, age_s=0.01)
            yield self.insider.signed(copy, now, secured)


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
    """States brakings of its own vehicle without end, where copies need what was stated."""

    reach: ClassVar[int] = 1

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """State `FLOOD_MESSAGES` of them."""
        own = self.insider.own_id(now)
        first = FLOOD_MESSAGES * round(now / STEP_S)
        for number in range(first, first + FLOOD_MESSAGES):
            yield self.insider.signed(braking(own, own, number), now)
