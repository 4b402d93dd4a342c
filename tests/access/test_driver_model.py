"""Reaction times of one driver, given those of the population."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.access.driver_model import DEFAULT_POPULATION, DriverModel


def batch_posterior(y: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same regression over all reactions at once, by the normal equations."""
    population = DEFAULT_POPULATION
    precision = np.linalg.inv(population.spread) + x.T @ x / population.noise_variance
    covariance = np.linalg.inv(precision)
    mean = covariance @ x.T @ (y - x @ population.coefficients) / population.noise_variance
    return mean, covariance


def test_the_recursive_update_equals_the_batch_regression() -> None:
    rng = np.random.default_rng(1)
    headway_s, reaction_s = rng.uniform(0.5, 3.0, 20), rng.uniform(0.5, 2.0, 20)
    driver = DriverModel(DEFAULT_POPULATION, forgetting=1.0)
    for tau, h in zip(reaction_s, headway_s, strict=True):
        driver.receive_reaction(tau, h)

    x = np.column_stack([np.ones(20), np.log(headway_s)])
    mean, covariance = batch_posterior(np.log(reaction_s), x)

    at = np.array([1.0, math.log(1.4)])
    expected_mean = at @ (DEFAULT_POPULATION.coefficients + mean)
    expected_sd = math.sqrt(at @ covariance @ at + DEFAULT_POPULATION.noise_variance)
    assert driver.log_reaction(1.4) == pytest.approx((expected_mean, expected_sd))


def test_without_reactions_the_model_is_that_of_the_population() -> None:
    driver = DriverModel(DEFAULT_POPULATION)

    median_s, low_s, high_s = driver.percentile_s(0.5, headway_s=1.0)

    assert median_s == pytest.approx(0.95)
    assert low_s < 0.7
    assert high_s > 1.3


def test_the_interval_covers_a_slow_driver_and_narrows_with_each_reaction() -> None:
    rng = np.random.default_rng(2)
    driver = DriverModel(DEFAULT_POPULATION)
    widths_s = []
    for _ in range(30):
        driver.receive_reaction(1.6 * math.exp(rng.normal(0.0, 0.25)), headway_s=1.5)
        _, low_s, high_s = driver.percentile_s(0.5, 1.5)
        widths_s.append(high_s - low_s)

    median_s, low_s, high_s = driver.percentile_s(0.5, 1.5)
    assert low_s < 1.6 < high_s
    assert median_s == pytest.approx(1.6, rel=0.12)
    assert widths_s[-1] < widths_s[4] < widths_s[0]


def test_impossible_reaction_times_are_rejected_and_counted() -> None:
    driver = DriverModel(DEFAULT_POPULATION)
    before = driver.log_reaction(1.0)

    for reaction_s, headway_s in [
        (0.05, 1.0),
        (20.0, 1.0),
        (1.0, 0.0),
        (math.nan, 1.0),
        (1.0, math.inf),
    ]:
        driver.receive_reaction(reaction_s, headway_s)

    assert driver.rejected == 5
    assert driver.log_reaction(1.0) == before


def test_forget_returns_to_the_population() -> None:
    driver = DriverModel(DEFAULT_POPULATION)
    driver.receive_reaction(2.0, 1.0)

    driver.reset()

    assert driver.log_reaction(1.3) == DriverModel(DEFAULT_POPULATION).log_reaction(1.3)
    assert driver.observed == 0


def test_old_reactions_lose_weight() -> None:
    driver = DriverModel(DEFAULT_POPULATION, forgetting=0.98)
    for _ in range(200):
        driver.receive_reaction(2.0, 1.5)
    for _ in range(100):
        driver.receive_reaction(0.8, 1.5)

    assert driver.percentile_s(0.5, 1.5)[0] == pytest.approx(0.8, rel=0.15)


@given(
    st.lists(st.tuples(st.floats(0.15, 6.0), st.floats(0.1, 10.0)), max_size=60),
    st.floats(0.05, 0.95),
)
def test_percentiles_are_ordered_for_any_reactions(
    reactions: list[tuple[float, float]], share: float
) -> None:
    driver = DriverModel(DEFAULT_POPULATION)
    for reaction_s, headway_s in reactions:
        driver.receive_reaction(reaction_s, headway_s)

    estimate_s, low_s, high_s = driver.percentile_s(share, 1.5)
    assert 0.0 < low_s <= estimate_s <= high_s < math.inf
