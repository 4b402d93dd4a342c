"""Cars are informed of braking by radio, by relays and by brake lights."""

from itertools import combinations

import networkx as nx
import numpy as np
import pytest

from sim_rig.studies.rakhshan.chain import Relay, lane_links, reception_delay_s, without_radio_s

SLOT_S = 0.000_222


def test_links_lead_to_cars_that_do_not_see_the_brake_lights() -> None:
    sender, receiver = lane_links(5)

    assert set(zip(sender.tolist(), receiver.tolist(), strict=True)) == {
        (j, i) for j, i in combinations(range(5), 2) if i - j >= 2
    }


def test_delay_is_the_shortest_path_of_radio_and_reactions() -> None:
    rng = np.random.default_rng(1)
    cars = 8
    slots = rng.uniform(50.0, 20_000.0, len(lane_links(cars).sender))
    reaction_s = rng.uniform(0.3, 2.0, cars)
    graph: nx.DiGraph[int] = nx.DiGraph()
    for (sender, receiver), count in zip(zip(*lane_links(cars), strict=True), slots, strict=True):
        after_s = 0.0 if sender == 0 else reaction_s[sender]
        graph.add_edge(int(sender), int(receiver), weight=after_s + SLOT_S * count)
    for i in range(cars - 1):
        graph.add_edge(i, i + 1, weight=0.0 if i == 0 else reaction_s[i])
    shortest = nx.single_source_dijkstra_path_length(graph, 0)

    delay_s = reception_delay_s(slots, SLOT_S, reaction_s)

    assert delay_s == pytest.approx([shortest[i] for i in range(cars)])


def test_without_radio_the_delay_is_the_sum_of_the_reaction_times_ahead() -> None:
    delay_s = without_radio_s(np.array([9.0, 1.0, 2.0, 4.0]))

    assert delay_s.tolist() == [0.0, 0.0, 1.0, 3.0]


def test_a_radio_without_reception_has_the_delay_of_brake_lights() -> None:
    reaction_s = np.array([0.0, 1.0, 1.5, 0.7, 2.0])
    never = np.full(len(lane_links(5).sender), np.inf)

    assert reception_delay_s(never, SLOT_S, reaction_s) == pytest.approx(
        without_radio_s(reaction_s)
    )


def test_lanes_are_vectorised() -> None:
    rng = np.random.default_rng(2)
    slots = rng.uniform(50.0, 5000.0, (3, 4, len(lane_links(6).sender)))
    reaction_s = rng.uniform(0.3, 2.0, (3, 1, 6))

    together = reception_delay_s(slots, SLOT_S, reaction_s)

    assert together.shape == (3, 4, 6)
    assert together[2, 1] == pytest.approx(reception_delay_s(slots[2, 1], SLOT_S, reaction_s[2, 0]))


@pytest.mark.parametrize(
    ("relay", "delay_s"),
    [
        (Relay.ANY, [0.0, 0.0, 1.0, 2.0, 3.5]),  # All by brake lights.
        (Relay.DIRECT, [0.0, 0.0, 1.0, 4.0, 6.0]),  # Car 3 sees car 2, car 4 hears car 1.
        (Relay.AS_PRINTED, [0.0, 0.0, 1.0, 4.0, 7.0]),  # Car 2's message takes 3 s, as car 0's.
    ],
)
def test_the_paper_allows_one_relay_that_car_0_informed(relay: Relay, delay_s: list[float]) -> None:
    link_s = {(0, 2): 3.0, (0, 3): 8.0, (0, 4): 20.0, (1, 3): 50.0, (1, 4): 5.0, (2, 4): 60.0}
    slots = np.array(list(link_s.values()))
    reaction_s = np.array([0.0, 1.0, 1.0, 1.5, 1.0])
    assert list(link_s) == list(zip(*(side.tolist() for side in lane_links(5)), strict=True))

    assert reception_delay_s(slots, 1.0, reaction_s, relay).tolist() == delay_s


@pytest.mark.parametrize("cars", [0, 1, 2])
def test_chains_too_short_for_radio_have_no_delay(cars: int) -> None:
    delay_s = reception_delay_s(np.zeros(0), SLOT_S, np.ones(cars))

    assert delay_s.tolist() == [0.0] * cars
