"""Assignment: gated, of greatest likelihood as a whole, and never one car to two pieces."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from onboard.tracking.association import CERTAIN_M, FARTHEST_INSIDE_M2, compare
from onboard.tracking.evidence import Estimate, Evidence, Measurement, as_arrays, measurement_id
from onboard.tracking.gates import GATE_PROBABILITY, are_inside, gate, gates, with_speed_prior

Q = 1.0


EARLY_MS = 1000
"""Time of what has no other."""


def measured(x_m: float, y_m: float = 0.0, sigma_m: float = 1.0, stamp_ms: int = 0) -> Measurement:
    identity = measurement_id(b"abcd", EARLY_MS + stamp_ms)
    return Measurement(identity, np.array([x_m, y_m]), np.eye(2) * sigma_m**2)


def car(x_m: float, y_m: float = 0.0, vx_m_s: float = 0.0, sigma_m: float = 1.0) -> Estimate:
    covariance = np.diag([sigma_m**2, sigma_m**2, 1.0, 1.0])
    return Estimate(
        frozenset({measurement_id(b"efgh", EARLY_MS)}),
        np.array([x_m, y_m, vx_m_s, 0.0]),
        covariance,
    )


def found(pieces: list[Evidence], cars: list[Estimate], gate: float = 0.99) -> dict[int, int]:
    return compare(as_arrays(pieces), as_arrays(cars), gate, Q).assign()


def test_each_piece_goes_to_the_car_where_it_was_measured() -> None:
    assert found([measured(10), measured(0)], [car(0.5), car(9.5)]) == {0: 1, 1: 0}


def test_what_is_near_no_car_is_assigned_to_none() -> None:
    assert found([measured(0), measured(50)], [car(0.5)]) == {0: 0}
    assert found([measured(0)], []) == {}
    assert found([], [car(0)]) == {}


@pytest.mark.parametrize("of_speed", [False, True])
@pytest.mark.parametrize("block", [[[1.0, 9.0], [9.0, 1.0]], [[-9.0, 0.0], [0.0, -9.0]]])
def test_nothing_is_near_to_a_car_whose_covariance_is_none(
    block: list[list[float]], of_speed: bool
) -> None:
    """Rounding can leave such a one; half of these would be at a distance below 0."""
    bad, at = car(0), slice(2, 4) if of_speed else slice(0, 2)
    bad.covariance[at, at] = np.array(block)

    assert found([car(0.1)], [bad]) == {}
    both = as_arrays([bad, car(0)])
    assert are_inside(as_arrays([car(0), car(0)]), both, 0.99, Q).tolist() == [False, True]
    measured_too = as_arrays([measured(0), car(0)])
    assert are_inside(measured_too, both, 0.99, Q).tolist() == [of_speed, True]


def test_only_near_pairs_need_comparison_where_evidence_must_be_certain() -> None:
    rng = np.random.default_rng(1)
    places_m, sigmas_m = rng.uniform(-6.0, 6.0, (80, 2)), rng.uniform(0.05, 0.5, 80)
    pieces = [measured(x, y, sigma) for (x, y), sigma in zip(places_m, sigmas_m, strict=True)]
    cars = [car(x, y, sigma_m=rng.uniform(0.05, 0.5)) for x, y in rng.uniform(-6.0, 6.0, (60, 2))]
    both = as_arrays(pieces), as_arrays(cars)
    apart_m = both[0].states[:2, :, None] - both[1].states[:2, None]
    near = (apart_m**2).sum(axis=0) <= FARTHEST_INSIDE_M2

    every = compare(*both, GATE_PROBABILITY, Q, max_sigma_m=CERTAIN_M)
    few = compare(*both, GATE_PROBABILITY, Q, max_sigma_m=CERTAIN_M, near=near)

    assert near.mean() < 0.3
    assert every.inside.sum() > 50
    assert np.array_equal(few.inside, every.inside)
    assert np.array_equal(few.cost[few.inside], every.cost[every.inside])
    assert few.assign() == every.assign()


def test_two_pieces_never_share_a_car() -> None:
    assert len(found([measured(0.0), measured(0.1)], [car(0)])) == 1


def test_the_best_for_all_is_taken_not_the_best_for_the_first() -> None:
    """Greedy would give the first piece the middle car and leave the second none."""
    assert found([measured(0.9), measured(2.2)], [car(-1.0), car(1.0)]) == {0: 0, 1: 1}


@pytest.mark.long
def test_the_gate_lets_in_what_its_probability_says() -> None:
    rng = np.random.default_rng(0)
    errors = rng.normal(0, np.sqrt(2), size=(4000, 2))  # car and piece: 1 m each

    inside = sum(bool(found([measured(x, y)], [car(0)], 0.95)) for x, y in errors)

    assert inside / 4000 == pytest.approx(0.95, abs=0.012)


def test_narrowed_gates_let_in_what_gates_of_the_lower_probability_do() -> None:
    pieces, cars = as_arrays([measured(0), measured(3.5), measured(6)]), as_arrays([car(0), car(6)])
    wide = compare(pieces, cars, GATE_PROBABILITY, Q)
    narrow = wide.narrowed(gates(pieces, 0.9))

    assert wide.inside.sum() > narrow.inside.sum() > 0
    assert np.array_equal(narrow.inside, compare(pieces, cars, 0.9, Q).inside)


def test_a_car_is_carried_to_the_time_of_the_piece_forwards_and_back() -> None:
    cars = [car(0, vx_m_s=20.0), car(10, vx_m_s=0.0)]

    assert found([measured(10, stamp_ms=500)], cars) in ({0: 0}, {0: 1})
    assert found([measured(20, stamp_ms=1000)], cars) == {0: 0}
    assert found([measured(-10, stamp_ms=-500)], cars) == {0: 0}


def test_an_estimate_is_also_held_against_the_speed() -> None:
    """Two cars that meet: same place, opposite ways."""
    cars = [car(0, vx_m_s=15.0), car(0.2, vx_m_s=-15.0)]

    assert found([car(0.2, vx_m_s=14.0)], cars) == {0: 0}
    assert found([car(0.0, vx_m_s=-14.0)], cars) == {0: 1}


def test_a_vaguely_known_car_does_not_attract_its_neighbours_evidence() -> None:
    vague, sharp = car(1.0, sigma_m=5.0), car(0.0, sigma_m=0.3)

    assert found([measured(0.7, sigma_m=0.5)], [vague, sharp]) == {0: 1}


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize(("many", "few"), [(4, 4), (6, 3)])
@pytest.mark.parametrize("pieces_are_more", [False, True])
def test_the_assignment_is_the_best_of_all(
    seed: int, many: int, few: int, *, pieces_are_more: bool
) -> None:
    """Against trying every assignment, for cars so close that all gates overlap."""
    rng = np.random.default_rng(seed)
    n_pieces, n_cars = (many, few) if pieces_are_more else (few, many)
    places = [rng.uniform(0, 2, 3) for _ in range(n_cars)]
    cars = [car(x_m, y_m, sigma_m=1.0 + more_m / 2) for x_m, y_m, more_m in places]
    pieces = [measured(*rng.uniform(0, 2, 2)) for _ in range(n_pieces)]

    def cost(pairs: tuple[tuple[int, int], ...]) -> float:
        total = 0.0
        for at, of in pairs:
            piece = pieces[at]
            difference = piece.position_m - cars[of].state[:2]
            spread = piece.covariance + cars[of].covariance[:2, :2]
            total += float(difference @ np.linalg.solve(spread, difference))
            total += float(np.log(np.linalg.det(spread)))
        return total

    def pairs(chosen: tuple[int, ...]) -> tuple[tuple[int, int], ...]:
        both = enumerate(chosen)
        return tuple((of, at) if pieces_are_more else (at, of) for at, of in both)

    best = min(map(pairs, permutations(range(many), few)), key=cost)

    assert found(list(pieces), cars, 0.999_999) == dict(best)


def test_of_a_car_seen_once_the_speed_is_taken_to_be_a_cars() -> None:
    measured_once = as_arrays([measured(0.0)]).with_unknown_speed(100.0)

    learnt = with_speed_prior(measured_once, 20.0).covariances[:, :, 0]

    expected = np.linalg.inv(np.diag([1, 1, 1e-4 + 1 / 400, 1e-4 + 1 / 400]))
    np.testing.assert_allclose(learnt, expected)


@given(probability=st.floats(1e-6, 1 - 1e-9), degrees_of_freedom=st.sampled_from([2, 4]))
def test_the_gate_is_a_quantile_of_chi_squared(probability: float, degrees_of_freedom: int) -> None:
    below = chi2.cdf(gate(probability, degrees_of_freedom), degrees_of_freedom)

    assert below == pytest.approx(probability, rel=1e-6)
