"""Insiders who abuse that the BSMs of both vehicles refresh a membership.

One lets a follower believe in a lead that has dropped it, the other one is ahead and lets the group
believe that it still leads.
"""

from collections.abc import Iterator
from typing import ClassVar

from typing_extensions import override

from onboard.messages.lcca import (
    NO_ID,
    Answer,
    Inquiry,
    Join,
    LccaMessage,
    Leave,
    LeaveReason,
    Reply,
)
from sim_rig.studies.attacks.attack_world import STEP_S
from sim_rig.studies.attacks.attacked_group import GAP_M, LEADER, PLATES
from sim_rig.studies.attacks.impostures import Imposture

LEAVES_EVERY, LEAVES_AT = 100, 10
"""Messages from one leave to the next, and before the first: some seconds before each braking."""
SILENT_S = 5.0
"""After a reply: longer than any membership lasts without one."""


class ForgedLeaves(Imposture):
    """Leaves in the followers' names: the BSMs of their leads tell them that all is well."""

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Leave once before each braking."""
        if round(now / STEP_S) % LEAVES_EVERY == LEAVES_AT:
            ids = [self.plates.car_id(plate, now) for plate in PLATES]
            for number, (ahead, leaves) in enumerate(zip(ids, ids[1:], strict=False), start=2):
                leave = Leave(leaves, ids[0], number, ahead, LeaveReason.GAP)
                yield self.insider.signed(leave, now)


class BsmsOnly(Imposture):
    """Drives ahead, is joined, and from then on sends its BSMs, but hardly a reply."""

    leads: ClassVar[bool] = True
    _replied_at = -SILENT_S

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Send a true BSM."""
        place_m = 0.0, self.group.way_m + GAP_M
        yield self.insider.bsm_at(place_m, (0.0, self.group.speed_m_s), now)

    @override
    def answers(self, message: LccaMessage, _secured: bytes, now: float) -> Iterator[bytes]:
        """Answer the vehicle behind, and reply to few of its joins."""
        own, asks, speed_m_s = self.insider.own_id(now), message.sender_id, self.group.speed_m_s
        if asks != self.plates.car_id(LEADER, now):
            return
        if isinstance(message, Inquiry):
            answer = Answer(own, asks, message.sequence, self.insider.temporary_id, speed_m_s)
            yield self.insider.signed(answer, now)
        elif isinstance(message, Join) and now >= self._replied_at + SILENT_S:
            self._replied_at = now
            reply = Reply(own, own, 1, asks, message.sequence, round(now), speed_m_s, NO_ID)
            yield self.insider.signed(self.insider.masked(reply, now), now)
