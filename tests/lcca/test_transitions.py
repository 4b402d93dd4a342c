"""The transition table, every pair of it, and the diagram drawn from it."""

from itertools import product
from pathlib import Path

import networkx as nx
import pytest

from onboard.lcca.transitions import (
    TRANSITIONS,
    GroupEvent,
    GroupState,
    TransitionError,
    next_state,
    state_diagram,
)

FOLLOWS_AHEAD = {GroupState.MEMBER}
"""The states of a car that follows another; the other fact is whether it is followed."""

CHANGES = {
    # event: (follows ahead before, after), (is followed before, after); None: either, unchanged
    GroupEvent.JOINED: ((None, True), (None, None)),
    GroupEvent.LEFT_ALONE: ((True, False), (False, False)),
    GroupEvent.LEFT_LEADING: ((True, False), (True, True)),
    GroupEvent.FOLLOWED: ((None, None), (False, True)),
    GroupEvent.UNFOLLOWED: ((None, None), (True, False)),
    GroupEvent.RENUMBERED: ((True, True), (None, None)),
}
"""What each event says about the two facts, from the theory at the head of the file."""


def state_of(*, follows: bool, is_followed: bool) -> GroupState:
    if follows:
        return GroupState.MEMBER
    return GroupState.LEADER if is_followed else GroupState.REGULAR


def expected(state: GroupState, event: GroupEvent) -> set[GroupState]:
    """Every state that the two facts allow after the event; empty if it cannot happen."""
    (follows_before, follows_after), (followed_before, followed_after) = CHANGES[event]
    out = set()
    for follows, is_followed in product((False, True), repeat=2):
        if state_of(follows=follows, is_followed=is_followed) is not state:
            continue
        if follows_before not in (None, follows) or followed_before not in (None, is_followed):
            continue
        out.add(
            state_of(
                follows=follows if follows_after is None else follows_after,
                is_followed=is_followed if followed_after is None else followed_after,
            )
        )
    return out


@pytest.mark.parametrize(("state", "event"), list(product(GroupState, GroupEvent)))
def test_every_pair_follows_from_the_two_facts(state: GroupState, event: GroupEvent) -> None:
    allowed = expected(state, event)
    if allowed:
        assert {next_state(state, event)} == allowed
    else:
        with pytest.raises(TransitionError, match=f"^{event.name} cannot happen to a {state.name}"):
            next_state(state, event)


def test_every_state_can_be_reached_and_left() -> None:
    graph = nx.DiGraph(
        (state, target) for state, row in TRANSITIONS.items() for target in row.values()
    )
    assert set(graph) == set(GroupState)
    assert nx.is_strongly_connected(graph)


def test_the_diagram_in_the_documentation_is_drawn_from_the_table() -> None:
    page = (Path(__file__).parents[2] / "docs" / "lcca.md").read_text(encoding="utf-8")
    assert f"```mermaid\n{state_diagram()}\n```" in page, (
        f"docs/lcca.md is to contain:\n{state_diagram()}"
    )


def test_the_diagram_shows_every_listed_pair() -> None:
    arrows = [line.split(" : ") for line in state_diagram().splitlines() if " : " in line]
    drawn = {
        (ends.strip().split(" --> ")[0], event, ends.strip().split(" --> ")[1])
        for ends, events in arrows
        for event in events.split(", ")
    }
    assert drawn == {
        (state.name, event.name, target.name)
        for state, row in TRANSITIONS.items()
        for event, target in row.items()
    }
