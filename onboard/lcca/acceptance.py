"""Which warnings are accepted. Each reason for refusal is a counted word.

The paper accepts a warning only from ahead and only from the same group. Positions are not known:
"ahead" means a smaller group number, "same group" the same leader. A warning is from ahead if the
braking vehicle is: a member that missed the first copy may accept the one that a vehicle behind
repeats.

That a braking is over, and nothing else, silences an alarm. So it is accepted from the predecessor
only, and goes from each vehicle to the next one, unless its vehicle is known to have signed it.

While an update about a new leader is on its way, leader and number lag. The predecessor is ahead
and in the own group whatever its header says, so it is always accepted.
"""

from onboard.lcca.group_position import GroupPosition
from onboard.lcca.transitions import GroupState
from onboard.messages.lcca import Warn, WarnCause


def warn_refusal(
    warn: Warn,
    state: GroupState,
    position: GroupPosition,
    *,
    from_predecessor: bool,
    is_proved: bool,
    lifetime_s: float,
) -> str | None:
    """Return why the first copy of a warning is refused, or `None` if it is accepted.

    Args:
        warn: the copy that was received.
        state: the receiver's state.
        position: the receiver's position in its group.
        from_predecessor: whether the receiver's predecessor sent this copy.
        is_proved: whether the braking vehicle is known to have stated it.
        lifetime_s: age above which a warning is refused.
    """
    if warn.age_s > lifetime_s:
        return "stale"
    if state is GroupState.REGULAR:
        return "not_in_group"
    if from_predecessor:
        return None
    if warn.leader_id != position.leader_id:
        return "other_group"
    if warn.origin_number >= position.number:
        return "from_behind"
    return "not_followed" if warn.cause is WarnCause.OVER and not is_proved else None
