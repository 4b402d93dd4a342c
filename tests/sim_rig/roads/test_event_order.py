"""The order of events: pairs once before twice, all strata in turn, the same for one seed."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sim_rig.roads.event_order import EventCandidate, FairOrder
from sim_rig.roads.events import EventSituation, TrafficEvent, TrafficEventKind

EVENTS = st.builds(
    lambda at_s, *, sets_off: TrafficEvent(TrafficEventKind.RED_LIGHT, 0, at_s, sets_off=sets_off),
    st.floats(0.0, 300.0),
    sets_off=st.booleans(),
)
SITUATIONS = st.builds(
    EventSituation,
    EVENTS,
    st.tuples(st.sampled_from("abcd"), st.sampled_from("efgh")),
    st.floats(0.0, math.pi),
    st.floats(0.0, 40.0),
)
CANDIDATES = st.lists(
    st.builds(EventCandidate, st.integers(0, 2), SITUATIONS), min_size=1, max_size=60
)


@given(CANDIDATES, st.integers(0, 50), st.integers(0, 5))
def test_each_pair_comes_once_before_any_comes_twice(
    candidates: list[EventCandidate], first: int, seed: int
) -> None:
    """From any number on, and with all that a pair has before it repeats one."""
    order = FairOrder(candidates, np.random.default_rng(seed))
    pairs = {candidate.pair for candidate in candidates}

    assert {order[number].pair for number in range(first, first + len(pairs))} == pairs
    again = FairOrder(candidates, np.random.default_rng(seed))
    assert [again[number] for number in range(20)] == [order[number] for number in range(20)]
    of_first = [order[number] for number in range(0, len(candidates) * len(pairs), len(pairs))]
    assert [each for each in candidates if each.pair == order[0].pair] == sorted(
        of_first[: len(order.pairs[0])], key=candidates.index
    )


@given(CANDIDATES)
def test_strata_take_turns(candidates: list[EventCandidate]) -> None:
    """None is ahead of another by more than one pair while both have pairs left."""
    order = FairOrder(candidates, np.random.default_rng(0))
    strata = [of_pair[0].stratum for of_pair in order.pairs]

    for number in range(1, len(strata)):
        left = set(strata[number:])
        taken = [strata[:number].count(stratum) for stratum in left]
        assert max(taken) - min(taken) <= 1


def test_a_stratum_is_a_range_of_angles_and_of_closing_speeds() -> None:
    event = TrafficEvent(TrafficEventKind.RED_LIGHT, 0, 1.0)

    def stratum(angle_deg: float, closing_m_s: float) -> tuple[int, int]:
        situation = EventSituation(event, ("a", "b"), math.radians(angle_deg), closing_m_s)
        return EventCandidate(0, situation).stratum

    assert [stratum(angle_deg, 5.0)[0] for angle_deg in (0, 40, 90, 150)] == [0, 1, 2, 3]
    assert [stratum(0, closing_m_s)[1] for closing_m_s in (5.0, 15.0, 25.0)] == [0, 1, 2]
