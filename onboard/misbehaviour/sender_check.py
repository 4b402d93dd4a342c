"""Who may send a group message: what signatures and BSMs say of its sender.

Two plates that differ by look-alike characters only have one communication ID, and an insider may
claim any where certificates commit to none. The predecessor is therefore known by its signer too;
if two have answered for it, both are accepted, but neither ends a warning. Of the vehicles ahead of
it, an ID that two signers use proves nothing: only what the predecessor repeats is accepted. And
who drives in the opposite direction is in no group of this one.
"""

import math

from onboard.messages.lcca import CarId, GroupMessage, Leave, Warn, WarnCause
from onboard.misbehaviour.misbehaviour_detection import MisbehaviourDetector

OPPOSITE_RAD = 2.1
"""Difference of headings (120 degrees) from which a vehicle is in no lane of the own direction."""


def sender_violation(
    message: GroupMessage,
    signer: bytes,
    misbehaviour: MisbehaviourDetector,
    *,
    predecessor_id: CarId | None,
    predecessor_signer: bytes | None,
    heading_rad: float | None,
) -> str | None:
    """Return why a signed message is refused, as a counted word, or `None` if it is accepted.

    Args:
        message: the message.
        signer: its signer.
        misbehaviour: knows who uses which ID, and the BSMs of all signers.
        predecessor_id: of the vehicle that this one follows; `None`: it follows none.
        predecessor_signer: its signer; `None` while it is not known, or two claim to be.
        heading_rad: of the own vehicle, clockwise from north; `None` if it is not known.
    """
    is_predecessor = message.sender_id == predecessor_id
    if is_predecessor and predecessor_signer not in (None, signer):
        return "another_signer"
    remote_rad = misbehaviour.heading_rad(signer)
    if heading_rad is not None and remote_rad is not None:
        turned_rad = math.remainder(remote_rad - heading_rad, math.tau)
        if abs(turned_rad) > OPPOSITE_RAD:
            return "opposite_direction"
    names: tuple[CarId, ...] = ()
    match message:
        case Leave():
            names = (message.sender_id,)
        case Warn(cause=WarnCause.OVER) if is_predecessor and predecessor_signer is None:
            names = (message.sender_id,)
        case Warn() if not is_predecessor:
            names = (message.sender_id, message.leader_id, message.event_origin_id)
    return None if all(map(misbehaviour.is_id_unique, names)) else "claimed_by_two"
