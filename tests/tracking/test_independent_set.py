"""The selection against the paper's examples, the paper's own search, networkx and scipy."""

import math
from itertools import combinations

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import Bounds, LinearConstraint, milp

from onboard.tracking.independent_set import select_independent, select_independent_masks

provenances = st.lists(
    st.frozensets(st.integers(0, 9), min_size=1, max_size=4), min_size=0, max_size=12
)


def graph_of(sets: list[frozenset[int]]) -> "nx.Graph[int]":
    """The paper's graph: a vertex per set, an edge between those with a common timestamp."""
    graph: nx.Graph[int] = nx.Graph()
    for index, provenance in enumerate(sets):
        graph.add_node(index, value=len(provenance))
    graph.add_edges_from((a, b) for a, b in combinations(range(len(sets)), 2) if sets[a] & sets[b])
    return graph


def solution_structures(total: int, largest: int) -> list[tuple[int, ...]]:
    """All ways to write `total` as a sum: 4 = {4}, {3,1}, {2,2}, {2,1,1}, {1,1,1,1}."""
    if total == 0:
        return [()]
    return [
        (part, *rest)
        for part in range(min(total, largest), 0, -1)
        for rest in solution_structures(total - part, part)
    ]


def paper_search(sets: list[frozenset[int]]) -> list[int]:
    """Section IV-B to the letter: totals downwards, structure by structure, the shortest first."""
    unique = len(frozenset().union(*sets)) if sets else 0
    for total in range(unique, 0, -1):
        for structure in sorted(solution_structures(total, total), key=len):
            # The subgraph of the vertices whose value occurs in the structure.
            subgraph = [i for i, provenance in enumerate(sets) if len(provenance) in structure]
            for chosen in combinations(subgraph, len(structure)):
                values = sorted((len(sets[i]) for i in chosen), reverse=True)
                if tuple(values) == structure and all(
                    not sets[a] & sets[b] for a, b in combinations(chosen, 2)
                ):
                    return list(chosen)
    return []


def test_figures_5_and_6_two_measurements_and_an_estimate_of_both() -> None:
    # n1 = {t1}, the estimate whose measurement was lost; n2 = {t2}, n3 = {t3}, n4 = {t2, t3}.
    sets = [frozenset({1}), frozenset({2}), frozenset({3}), frozenset({2, 3})]

    graph = graph_of(sets)

    assert set(graph.edges) == {(1, 3), (2, 3)}
    # "Choosing vertices {n1, n2, n3} or {n1, n4} yields the same total vertex value 3":
    # the one with fewer entries costs fewer runs of the filter.
    assert select_independent(sets) == [0, 3]


def test_figure_7_two_pairs_cover_what_one_and_three_cannot() -> None:
    # The figure's edges are not in the text; these sets fulfil all that it says about them: four
    # timestamps, no vertex of value 4, {1,3} without a solution, {2,2} solved by {n1, n3}.
    sets = [frozenset({1, 2}), frozenset({2, 3}), frozenset({3, 4}), frozenset({1, 3, 4}),
            frozenset({1}), frozenset({3})]  # fmt: skip

    structures = sorted(solution_structures(4, 4), key=len)
    assert structures == [(4,), (3, 1), (2, 2), (2, 1, 1), (1, 1, 1, 1)]
    left = [provenance for provenance in sets if len(provenance) in (1, 3)]
    assert all(a & b for a, b in combinations(left, 2) if len(a) + len(b) == 4)

    assert paper_search(sets) == [0, 2]
    assert select_independent(sets) == [0, 2]


@given(provenances)
def test_it_takes_as_many_measurements_and_as_few_entries_as_the_papers_search(
    sets: list[frozenset[int]],
) -> None:
    chosen, expected = select_independent(sets), paper_search(sets)

    assert sum(len(sets[i]) for i in chosen) == sum(len(sets[i]) for i in expected)
    assert len(chosen) == len(expected)


@given(provenances)
def test_no_measurement_is_taken_twice(sets: list[frozenset[int]]) -> None:
    taken = [measurement for i in select_independent(sets) for measurement in sets[i]]

    assert len(taken) == len(set(taken))


@given(st.lists(st.frozensets(st.integers(0, 40), min_size=1, max_size=9), max_size=24))
def test_its_total_is_networkx_maximum_weight_clique_of_the_complement(
    sets: list[frozenset[int]],
) -> None:
    complement = nx.complement(graph_of(sets))
    nx.set_node_attributes(complement, {i: len(sets[i]) for i in complement}, "value")

    _, expected = nx.max_weight_clique(complement, "value")

    assert sum(len(sets[i]) for i in select_independent(sets)) == expected


@pytest.mark.parametrize("seed", range(20))
def test_its_total_and_number_of_entries_are_those_of_an_integer_programme(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sets = [
        frozenset(rng.choice(30, size=rng.integers(1, 6), replace=False).tolist())
        for _ in range(24)
    ]
    # Maximise measurements, then the fewest entries: an entry costs less than one measurement.
    worth = np.array([len(provenance) - 1 / 100 for provenance in sets])
    uses = np.array([[timestamp in provenance for provenance in sets] for timestamp in range(30)])

    programme = milp(
        -worth, constraints=LinearConstraint(uses, ub=1), bounds=Bounds(0, 1),
        integrality=np.ones(len(sets), int),
    )  # fmt: skip

    chosen = select_independent(sets)
    assert programme.fun is not None
    assert math.isclose(worth[chosen].sum(), -programme.fun, abs_tol=1e-6)


def test_measurements_alone_are_all_taken_once() -> None:
    assert select_independent([frozenset({1}), frozenset({2}), frozenset({1})]) == [0, 1]


def test_an_estimate_replaces_its_measurements_only_if_that_saves_entries() -> None:
    # {1,2} with {3} or the three alone: as much either way, and the estimate spares one entry.
    sets = [frozenset({1}), frozenset({2}), frozenset({3}), frozenset({1, 2})]
    assert select_independent(sets) == [2, 3]

    # {2,9} adds measurement 9, but would replace nothing else.
    assert select_independent([*sets[:3], frozenset({2, 9})]) == [0, 2, 3]


def test_among_equals_the_earlier_entry_is_preferred() -> None:
    assert select_independent([frozenset({1, 2}), frozenset({2, 3})]) == [0]
    assert select_independent([frozenset({2, 3}), frozenset({1, 2})]) == [0]


def test_nothing_comes_of_nothing() -> None:
    assert select_independent([]) == []
    assert select_independent([frozenset()]) == []
    assert select_independent_masks([0, 0]) == []


def test_what_would_double_the_states_at_every_step_is_chosen_of_at_once() -> None:
    """Pairs {e_i, x_i} that leave open which x are taken, 2^60 ways, and one of all x."""
    n = 60
    masks = [1 << i | 1 << n + i for i in range(n)] + [(1 << n) - 1 << n]

    assert select_independent_masks(masks) == list(range(n))


def test_sets_made_to_be_hard_stay_within_a_bounded_number_of_steps() -> None:
    # Twelve pairs {i, i + 12}, and twelve that join their ends: the most undecided combinations.
    hard = [1 << i | 1 << i + 12 for i in range(12)]
    hard += [1 << i + 12 | 1 << (i + 1) % 12 + 12 for i in range(12)]

    chosen = select_independent_masks(hard)

    assert sum(hard[i].bit_count() for i in chosen) == 24
