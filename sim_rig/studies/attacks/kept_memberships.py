"""An insider who abuses that the BSMs of both vehicles refresh a membership."""

from collections.abc import Iterator
from itertools import pairwise

from typing_extensions import override

from onboard.messages.lcca import Leave, LeaveReason
from sim_rig.studies.attacks.attack_world import STEP_S
from sim_rig.studies.attacks.attacked_group import PLATES
from sim_rig.studies.attacks.impostures import Imposture

LEAVES_EVERY, LEAVES_AT = 100, 10
"""Messages from one leave to the next, and before the first: some seconds before each braking."""


class ForgedLeaves(Imposture):
    """Leaves in the followers' names: the BSMs of their leads tell them that all is well."""

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Leave once before each braking."""
        if round(now / STEP_S) % LEAVES_EVERY == LEAVES_AT:
            ids = [self.plates.car_id(plate, now) for plate in PLATES]
            for number, (ahead, leaves) in enumerate(pairwise(ids), start=2):
                leave = Leave(leaves, ids[0], number, ahead, LeaveReason.GAP)
                yield self.insider.signed(leave, now)
