"""The states of a warning group, and the only code that decides a vehicle's state.

Theory
======

A warning group is a row of vehicles in one lane, each closer to the one ahead than the safety
distance. No vehicle holds a list of all members. The group consists of pairs: a vehicle *follows*
its *predecessor*, the lead vehicle that its camera shows, from the reply to its join until it
leaves. The state follows from two facts that each vehicle knows without others:

- does it follow a predecessor (its join was answered, and it has not left since)?
- is it followed (it has followers)?

    follows | is followed | state
    --------|-------------|--------
    no      | no          | REGULAR
    no      | yes         | LEADER
    yes     | no or yes   | MEMBER

No message sets a state directly: a vehicle becomes LEADER when it leaves and is followed, or when
it is followed and does not follow. The two facts change one at a time, each in two directions,
which gives four events; two more concern a vehicle that stays a member:

- FOLLOWED, UNFOLLOWED: the vehicle got its first follower, or lost its last one.
- JOINED: the lead vehicle answered and is now the predecessor. A member that JOINED changes its
  predecessor without having left the group in between.
- LEFT_LEADING, LEFT_ALONE: the vehicle follows no longer, and is followed or not. Two events, so
  that the table needs no condition.
- RENUMBERED: leader or number changed because of a change further ahead.

Warnings by state: a leader has no vehicle ahead to be warned by. A member accepts warnings from
ahead and forwards them. A regular vehicle neither sends nor accepts warnings.

The leader has number 1, every other member its predecessor's number plus one. The number is the
count of vehicles ahead in the group plus one, and gives receivers without positions the order.

The paper's figure 2 has the same states; it omits the pairs that only arise with a lossy radio or
with a second follower.
"""

from enum import Enum


class GroupState(Enum):
    """A vehicle's state in its warning group (LCCA, section 3)."""

    REGULAR = "regular"
    LEADER = "leader"
    MEMBER = "member"


class GroupEvent(Enum):
    """What can change a vehicle's state."""

    JOINED = "joined"
    LEFT_ALONE = "left_alone"
    LEFT_LEADING = "left_leading"
    FOLLOWED = "followed"
    UNFOLLOWED = "unfollowed"
    RENUMBERED = "renumbered"


TRANSITIONS: dict[GroupState, dict[GroupEvent, GroupState]] = {
    GroupState.REGULAR: {
        GroupEvent.JOINED: GroupState.MEMBER,
        GroupEvent.FOLLOWED: GroupState.LEADER,
    },
    GroupState.LEADER: {
        GroupEvent.JOINED: GroupState.MEMBER,
        GroupEvent.UNFOLLOWED: GroupState.REGULAR,
    },
    GroupState.MEMBER: {
        GroupEvent.JOINED: GroupState.MEMBER,
        GroupEvent.RENUMBERED: GroupState.MEMBER,
        GroupEvent.FOLLOWED: GroupState.MEMBER,
        GroupEvent.UNFOLLOWED: GroupState.MEMBER,
        GroupEvent.LEFT_ALONE: GroupState.REGULAR,
        GroupEvent.LEFT_LEADING: GroupState.LEADER,
    },
}


class TransitionError(Exception):
    """An event that the table does not allow: a defect of this package, not of a message."""


def next_state(state: GroupState, event: GroupEvent) -> GroupState:
    """Return the state after `event`.

    Raises:
        TransitionError: the pair is not in the table; the message names state and event.
    """
    try:
        return TRANSITIONS[state][event]
    except KeyError:
        raise TransitionError(f"{event.name} cannot happen to a {state.name} vehicle") from None


def state_diagram() -> str:
    """Return the table as a Mermaid state diagram, for docs/lcca.md."""
    lines = ["stateDiagram-v2", f"    [*] --> {GroupState.REGULAR.name}"]
    for state, row in TRANSITIONS.items():
        by_target: dict[GroupState, list[str]] = {}
        for event, target in row.items():
            by_target.setdefault(target, []).append(event.name)
        lines += [
            f"    {state.name} --> {target.name} : {', '.join(events)}"
            for target, events in by_target.items()
        ]
    return "\n".join(lines)
