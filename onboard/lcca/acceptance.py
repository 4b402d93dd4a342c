"""Which updates and warnings are accepted. Each reason for refusal is a counted word.

The paper accepts an update or a warning only from ahead and only from the same group. Positions are
not known: "ahead" means a smaller group number, "same group" the same leader. A warning is from
ahead if the braking vehicle is: a member that missed the first copy may accept the one that a
vehicle behind repeats.

That a braking is over, and nothing else, silences an alarm. So it is accepted from the predecessor
only, and goes from each vehicle to the next one.

While an update about a new leader is on its way, leader and number lag. The predecessor is ahead
and in the own group whatever its header says, so it is always accepted.
"""

from onboard.lcca.group_position import GroupPosition
from onboard.lcca.transitions import GroupState
from onboard.messages.lcca import CarId, Update, Warn, WarnCause


def warn_refusal(
    warn: Warn,
    state: GroupState,
    position: GroupPosition,
    *,
    from_predecessor: bool,
    lifetime_s: float,
) -> str | None:
    """Return why the first copy of a warning is refused, or `None` if it is accepted.

    Args:
        warn: the copy that was received.
        state: the receiver's state.
        position: the receiver's position in its group.
        from_predecessor: whether the receiver's predecessor sent this copy.
        lifetime_s: age above which a warning is refused.
    """
    if warn.age_s > lifetime_s:
        return "stale"
    refusal = _group_refusal((warn.leader_id,), state, position, from_predecessor=from_predecessor)
    if refusal is not None or from_predecessor:
        return refusal
    if warn.origin_number >= position.number:
        return "from_behind"
    return "not_followed" if warn.cause is WarnCause.OVER else None


def update_refusal(
    update: Update,
    number: int,
    state: GroupState,
    position: GroupPosition,
    *,
    from_predecessor: bool,
    now: float,
) -> str | None:
    """Return why the first copy of an update is refused, or `None` if it is accepted.

    Args:
        update: the copy that was received.
        number: the group number that the receiver would have after it.
        state: the receiver's state.
        position: the receiver's position in its group.
        from_predecessor: whether the receiver's predecessor sent this copy.
        now: seconds on the cores' clock.
    """
    leaders = (update.previous_leader_id, update.leader_id)
    refusal = _group_refusal(leaders, state, position, from_predecessor=from_predecessor)
    if refusal is not None:
        return refusal
    if from_predecessor:
        is_settled = (update.leader_id, number) == position.in_group
    elif position.leader_id != update.previous_leader_id:
        is_settled = True
    elif number <= update.number:
        return "from_behind"
    else:  # Within one group, a reply may have renumbered this vehicle: no shift counts twice.
        is_same = position.leader_id == update.leader_id
        is_settled = is_same and not position.is_newer(update.leader_id, update.leader_sequence)
    if is_settled:
        return "up_to_date"
    forms_loop = position.forms_loop(update.leader_id, number, update.leader_sequence, now)
    return "loop" if forms_loop else None


def _group_refusal(
    leaders: tuple[CarId, ...],
    state: GroupState,
    position: GroupPosition,
    *,
    from_predecessor: bool,
) -> str | None:
    """Return why a message that travels backwards in one of these groups is refused."""
    if state is GroupState.REGULAR:
        return "not_in_group"
    if from_predecessor:
        return None
    if position.leader_id not in leaders:
        return "other_group"
    return "from_behind" if state is GroupState.LEADER else None
