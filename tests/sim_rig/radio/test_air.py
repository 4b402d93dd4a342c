"""The air: who hears whom, when, and what a bad channel does."""

import math

import networkx as nx
import numpy as np
import pytest

from sim_rig.radio.air import Delivery
from sim_rig.radio.reach import ReachAir
from sim_rig.roads.road import CarState
from sim_rig.scenario.radio_settings import ReachSettings

UNITS = ["a", "b", "c", "d"]
SPACING_M = 20.0


def row_of_cars(_now: float) -> dict[str, CarState]:
    return {
        name: CarState(-SPACING_M * index, 0.0, 1.57, 0.0, 0.0, 15.0, 0.0, 4.5, 1.8, 1.5)
        for index, name in enumerate(UNITS)
    }


def make_air(seed: int = 1, **settings: object) -> ReachAir:
    reach = {} if "neighbours" in settings else {"reach_m": 45.0}
    return ReachAir(
        ReachSettings.model_validate(reach | settings),
        row_of_cars,
        UNITS,
        np.random.default_rng(seed),
    )


def all_deliveries(air: ReachAir) -> list[Delivery]:
    delivered = []
    while (at := air.get_timer()) < math.inf:
        delivered += air.wsms_to_deliver(at)
    return delivered


def test_all_in_reach_but_the_sender_receive_after_the_delay() -> None:
    air = make_air(delay_s=0.002)
    air.receive_wsm("b", b"hello", 7, 10.0)

    assert air.get_timer() == 10.002
    assert air.wsms_to_deliver(10.001) == []
    heard = air.wsms_to_deliver(10.002)
    assert [(copy.receiver, copy.wsm, copy.user_priority) for copy in heard] == [
        ("a", b"hello", 7),
        ("c", b"hello", 7),
        ("d", b"hello", 7),
    ]
    assert air.get_timer() == math.inf


def test_the_reach_graph_of_a_row_joins_cars_up_to_two_apart() -> None:
    expected = nx.Graph([("p", "q"), ("q", "r"), ("r", "s"), ("p", "r"), ("q", "s")])

    graph = make_air().reach_graph(0.0)

    assert nx.is_isomorphic(graph, expected)
    assert nx.shortest_path_length(graph, "a", "d") == 2


def test_neighbours_by_name_receive_each_other_at_any_distance() -> None:
    air = make_air(neighbours={"a": ("d",)})
    air.receive_wsm("d", b"", 0, 0.0)
    air.receive_wsm("b", b"", 0, 0.0)

    assert [copy.receiver for copy in all_deliveries(air)] == ["a"]


def test_without_jitter_frames_arrive_as_they_were_sent() -> None:
    air = make_air()
    for number in range(20):
        air.receive_wsm("a", bytes([number]), 0, 0.0)

    assert [copy.wsm[0] for copy in all_deliveries(air) if copy.receiver == "b"] == list(range(20))


@pytest.mark.parametrize("loss", [0.0, 0.3, 1.0])
def test_each_copy_is_lost_by_itself_at_the_rate_given(loss: float) -> None:
    air = make_air(loss=loss)
    for _ in range(2000):
        air.receive_wsm("b", b"", 0, 0.0)

    share = len(all_deliveries(air)) / 6000
    # Four standard deviations of a binomial share with n = 6000.
    assert share == pytest.approx(1 - loss, abs=4 * np.sqrt(loss * (1 - loss) / 6000))


def test_duplicated_copies_arrive_twice() -> None:
    air = make_air(duplication=1.0)
    air.receive_wsm("a", b"", 0, 0.0)

    assert sorted(copy.receiver for copy in all_deliveries(air)) == ["b", "b", "c", "c"]


def test_delayed_copies_are_overtaken() -> None:
    air = make_air(reordering=0.5, hold_back_s=0.1)
    for number in range(20):
        air.receive_wsm("a", bytes([number]), 0, 0.001 * number)

    heard = [copy.wsm[0] for copy in all_deliveries(air) if copy.receiver == "b"]
    assert sorted(heard) == list(range(20))
    assert heard != sorted(heard)


def test_jitter_stays_within_its_bound() -> None:
    air = make_air(delay_s=0.01, jitter_s=0.02)
    for _ in range(200):
        air.receive_wsm("a", b"", 0, 5.0)

    stamps = [copy.at_s for copy in all_deliveries(air)]
    assert 5.01 <= min(stamps) < 5.012
    assert 5.028 < max(stamps) <= 5.03


def test_the_same_seed_gives_the_same_deliveries() -> None:
    def fates(seed: int) -> list[Delivery]:
        air = make_air(seed, loss=0.3, jitter_s=0.01, duplication=0.1, reordering=0.1)
        for number in range(50):
            air.receive_wsm("b", b"", 0, 0.01 * number)
        return all_deliveries(air)

    assert fates(3) == fates(3)
    assert fates(3) != fates(4)
