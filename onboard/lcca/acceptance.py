"""Which messages from the air are believed. Each refusal is a word that is counted.

The paper's rule for an update or a warning is: only from ahead, only from the same group. Positions
are not known, so "ahead" is "with a smaller number", and "same group" is "with the same leader".
A warning is from ahead if the braking car is: whoever has missed the first copy may believe the
one that a car behind repeats.

While news of a new leader is on its way, leader and number lag. The car that we follow is ahead of
us and in our group whatever it says about them, so it is always believed.
"""

from onboard.lcca.group_position import GroupPosition
from onboard.lcca.transitions import GroupState
from onboard.messages.lcca import CarId, Update, Warn


def warn_refusal(
    warn: Warn,
    state: GroupState,
    place: GroupPosition,
    *,
    from_predecessor: bool,
    lifetime_s: float,
) -> str | None:
    """Return why a warning heard for the first time is not for us, or `None` if it is."""
    if warn.age_s > lifetime_s:
        return "stale"
    refusal = _group_refusal((warn.leader_id,), state, place, from_predecessor=from_predecessor)
    if refusal is None and not from_predecessor and warn.origin_number >= place.number:
        return "from_behind"
    return refusal


def update_refusal(
    update: Update,
    number: int,
    state: GroupState,
    place: GroupPosition,
    *,
    from_predecessor: bool,
    now: float,
) -> str | None:
    """Return why an update is not for us, or `None`; `number` would be ours by it."""
    leaders = (update.previous_leader_id, update.leader_id)
    refusal = _group_refusal(leaders, state, place, from_predecessor=from_predecessor)
    if refusal is not None:
        return refusal
    if from_predecessor:
        is_settled = (update.leader_id, number) == place.in_group
    elif place.leader_id != update.previous_leader_id:
        is_settled = True
    elif number <= update.number:
        return "from_behind"
    else:  # Within one group, a reply may have renumbered us already: no shift counts twice.
        is_same = place.leader_id == update.leader_id
        is_settled = is_same and not place.is_news(update.leader_id, update.beat)
    if is_settled:
        return "up_to_date"
    return "loop" if place.closes_circle(update.leader_id, number, update.beat, now) else None


def _group_refusal(
    leaders: tuple[CarId, ...], state: GroupState, place: GroupPosition, *, from_predecessor: bool
) -> str | None:
    """Return why a message to one of these groups, going backwards, cannot be for us."""
    if state is GroupState.REGULAR:
        return "not_in_group"
    if from_predecessor:
        return None
    if place.leader_id not in leaders:
        return "other_group"
    return "from_behind" if state is GroupState.LEADER else None
