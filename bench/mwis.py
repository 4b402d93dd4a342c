"""Independent sets of evidence a second, of 8 to 24 vertices, compared with networkx.

All three solve every problem and must agree on the weight. Times are processor times, since the
machine is shared.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from statistics import median

import networkx as nx
import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp

from bench import Figure
from onboard.tracking.independent_set import select_independent_masks

ROUNDS = 7


def measure() -> Iterator[Figure]:
    """Yield solves/s for each size, compared with networkx and with milp."""
    for vertices, problems_of_milp in ((8, 60), (16, 40), (24, 30)):
        rng = np.random.default_rng(vertices)
        problems = [_problem(vertices, rng) for _ in range(300)]
        weights = [_weight(masks, select_independent_masks(masks)) for masks in problems]
        rates, networkx_rates = [], []
        for _ in range(ROUNDS):
            rates.append(_rate(select_independent_masks, problems))
            networkx_rates.append(_rate(_by_networkx, problems[:100]))
        for masks, weight in zip(problems, weights, strict=True):
            if _by_networkx(masks) != weight:
                raise AssertionError(f"networkx finds another weight than {weight} for {masks}")
        for masks, weight in zip(problems[:problems_of_milp], weights, strict=False):
            if _by_milp(masks) != weight:
                raise AssertionError(f"milp finds another weight than {weight} for {masks}")
        by_milp = _rate(_by_milp, problems[:problems_of_milp])
        name = f"mwis.{vertices}_vertices"
        yield Figure(
            name,
            median(rates),
            "solves/s",
            ROUNDS,
            "networkx max_weight_clique",
            median(networkx_rates),
        )
        yield Figure(name, median(rates), "solves/s", ROUNDS, "scipy milp", by_milp)


def _problem(vertices: int, rng: np.random.Generator) -> list[int]:
    """Random provenances: a third single measurements, the rest of two to four."""
    masks: set[int] = set()
    while len(masks) < vertices:
        size = rng.choice([1, 1, 2, 2, 3, 4])
        chosen = rng.choice(vertices, size, replace=False).tolist()
        masks.add(sum(1 << bit for bit in chosen))
    return [int(mask) for mask in rng.permutation(list(masks))]


def _rate(solve: Callable[[Sequence[int]], object], problems: Sequence[Sequence[int]]) -> float:
    started = time.process_time()
    for masks in problems:
        solve(masks)
    return len(problems) / (time.process_time() - started)


def _weight(masks: Sequence[int], chosen: Sequence[int]) -> int:
    if any(masks[a] & masks[b] for a, b in combinations(chosen, 2)):
        raise AssertionError(f"{chosen} is not independent")
    return sum(masks[index].bit_count() for index in chosen)


def _by_networkx(masks: Sequence[int]) -> int:
    """Solve as the maximum-weight clique of the complement graph."""
    complement: nx.Graph[int] = nx.Graph()
    for index, mask in enumerate(masks):
        complement.add_node(index, weight=mask.bit_count())
    complement.add_edges_from(
        (a, b) for a, b in combinations(range(len(masks)), 2) if not masks[a] & masks[b]
    )
    return int(nx.max_weight_clique(complement, "weight")[1])


def _by_milp(masks: Sequence[int]) -> int:
    """Solve as an integer programme: no measurement in two of the selected."""
    bits = range(max(masks).bit_length())
    uses = np.array([[mask >> bit & 1 for mask in masks] for bit in bits])
    weights = np.array([mask.bit_count() for mask in masks])
    solution = milp(
        -weights,
        constraints=LinearConstraint(uses, ub=1),
        bounds=Bounds(0, 1),
        integrality=np.ones(len(masks), dtype=np.int64),
    )
    if solution.fun is None:
        raise AssertionError(f"milp finds no solution for {masks}: {solution.message}")
    return round(-solution.fun)
