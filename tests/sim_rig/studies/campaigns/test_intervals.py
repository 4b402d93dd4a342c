"""Intervals of shares, against statsmodels and SciPy."""

import math

import numpy as np
import pytest
from scipy.stats import bootstrap
from statsmodels.stats.proportion import proportion_confint
from statsmodels.stats.weightstats import DescrStatsW

from sim_rig.studies.campaigns.intervals import cluster_interval, half_interval, wilson


@pytest.mark.parametrize("n", [2, 3, 20, 200])
def test_the_interval_of_a_mean_is_that_of_as_few_samples(n: int) -> None:
    samples = np.random.default_rng(n).normal(5.0, 2.0, n)

    low, high = DescrStatsW(samples).tconfint_mean()

    assert float(half_interval(samples)) == pytest.approx((high - low) / 2)


def test_one_sample_tells_nothing_of_an_interval() -> None:
    assert np.isnan(half_interval(np.array([[1.0], [2.0]]))).all()


@pytest.mark.parametrize(("crashes", "runs"), [(0, 10), (3, 10), (500, 1000), (10, 10)])
def test_the_interval_of_independent_events_is_wilsons(crashes: int, runs: int) -> None:
    p, low, high = wilson(crashes / runs, runs)

    reference = proportion_confint(crashes, runs, method="wilson")

    assert p == crashes / runs
    assert (low, high) == pytest.approx(reference, abs=1e-4)


def test_the_interval_of_clusters_is_the_bootstraps() -> None:
    rng = np.random.default_rng(3)
    wholes = rng.integers(1, 40, 30).astype(float)
    parts = rng.binomial(wholes.astype(int), rng.beta(2, 3, 30)).astype(float)

    low, high = cluster_interval(range(30), parts.tolist(), wholes.tolist())

    reference = bootstrap(
        (parts, wholes),
        lambda a, b, axis: a.sum(axis) / b.sum(axis),
        paired=True,
        method="percentile",
        rng=np.random.default_rng(1),
    ).confidence_interval
    assert (low, high) == pytest.approx((reference.low, reference.high), abs=0.01)


def test_events_of_one_cluster_count_as_one() -> None:
    """Seven pairs of seventy events each tell as much as seven events."""
    avoided = [1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    many = [(pair, avoided[pair]) for pair in range(7) for _ in range(70)]

    seven = cluster_interval(range(7), avoided, [1.0] * 7)

    pairs, outcomes = zip(*many, strict=True)
    assert cluster_interval(pairs, outcomes, [1.0] * len(many)) == pytest.approx(seven)


@pytest.mark.parametrize("wholes", [[2.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
def test_one_cluster_has_no_interval(wholes: list[float]) -> None:
    low, high = cluster_interval(["a", "a", "b"], [1.0, 0.0, 0.0], wholes)

    assert math.isnan(low)
    assert math.isnan(high)
