"""The rules of a warning group, and the only place that decides a car's state.

Theory
======

A warning group is a row of cars in one lane, each closer to the one ahead than it could safely
brake. It has no list and no owner. It is nothing but the sum of pairs: a car *follows* the car that
its camera shows ahead, from the answer to its join until it leaves. Everything else follows from
two facts that a car knows by itself:

- do I follow the car ahead (my join was answered, and I have not left since)?
- does anybody follow me (my warning list is not empty)?

    follows the car ahead | is followed | state
    ----------------------|-------------|--------
    no                    | no          | REGULAR
    no                    | yes         | LEADER
    yes                   | no or yes   | MEMBER

So a state is never commanded from outside. No message makes a car a leader: it becomes one when it
leaves and is followed, or when it is followed and did not follow. Two facts change one at a time,
each in two directions, which gives four events; two more happen to a car that stays a member:

- FOLLOWED, UNFOLLOWED: the first car came onto the warning list, the last one went off it.
- JOINED: the car ahead answered. A member that JOINED has changed the car it follows, without
  having been out of a group in between.
- LEFT_LEADING, LEFT_ALONE: we follow nobody any more; somebody, nobody follows us. Two events, not
  one, so that the table needs no condition.
- RENUMBERED: our leader or number changed because something changed further ahead.

What the states mean for warnings: a leader has nobody ahead to be warned by. A member believes
warnings from ahead and hands them on. A regular car warns nobody and is warned by nobody.

The leader has number 1, every other car the number of the car it follows, plus one. A number says
how many cars ahead there are to be warned by, and tells receivers without positions who is ahead
of whom.

The paper's figure 2 draws the same states; it leaves out the pairs that only a lossy radio or a
second car on the warning list brings about.
"""

from enum import Enum


class GroupState(Enum):
    """What a car is in its warning group (LCCA, section 3)."""

    REGULAR = "regular"
    LEADER = "leader"
    MEMBER = "member"


class GroupEvent(Enum):
    """What can change a car's state."""

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
    """An event that the table does not allow: a mistake in this room, not in a message."""


def next_state(state: GroupState, event: GroupEvent) -> GroupState:
    """Look the pair up.

    Raises:
        TransitionError: it is not in the table; the message names state and event.
    """
    try:
        return TRANSITIONS[state][event]
    except KeyError:
        raise TransitionError(f"{event.name} cannot happen to a {state.name} car") from None


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
