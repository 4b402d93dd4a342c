"""95 % intervals: of a mean, and of shares of independent events and of events in clusters."""

import math
from collections.abc import Hashable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student_t

Array = NDArray[np.float64]

Z_95 = 1.96
"""97.5 % quantile of the normal distribution."""
_RESAMPLES = 4000


def half_interval(samples: Array) -> Array:
    """Half of the 95 % interval of the mean over the last axis, by Student's t.

    NaN with fewer than two samples, which tell nothing of the variation between them.
    """
    n = samples.shape[-1]
    if n < 2:
        return np.full(samples.shape[:-1], np.nan)
    half: Array = student_t.ppf(0.975, n - 1) * samples.std(axis=-1, ddof=1) / math.sqrt(n)
    return half


def wilson(p: float, n: int) -> tuple[float, float, float]:
    """A share `p` of n, limited to 0 to 1, and Wilson's 95 % interval of its probability."""
    p = min(max(p, 0.0), 1.0)
    middle = (p + Z_95**2 / (2 * n)) / (1 + Z_95**2 / n)
    half = Z_95 * math.sqrt(p * (1 - p) / n + Z_95**2 / (4 * n * n)) / (1 + Z_95**2 / n)
    return p, middle - half, middle + half


def cluster_interval(
    clusters: Sequence[Hashable], parts: Sequence[float], wholes: Sequence[float]
) -> tuple[float, float]:
    """The 95 % interval of sum(parts) / sum(wholes) by the cluster bootstrap (percentiles).

    Whole clusters are drawn again, since the events of one are not independent of each other.

    Args:
        clusters: cluster of each event.
        parts: numerator of each event.
        wholes: denominator of each event.

    Returns:
        Lower and upper bound; NaN with fewer than two clusters that have a denominator, which tell
        nothing of the variation between clusters.
    """
    names = {name: at for at, name in enumerate(dict.fromkeys(clusters))}
    sums = np.zeros((len(names), 2))
    np.add.at(sums, [names[name] for name in clusters], np.array([parts, wholes]).T)
    if np.count_nonzero(sums[:, 1]) < 2:
        return math.nan, math.nan
    n = len(names)
    drawn = np.random.default_rng(0).multinomial(n, np.full(n, 1.0 / n), _RESAMPLES) @ sums
    shares = drawn[drawn[:, 1] > 0.0]
    low, high = np.percentile(shares[:, 0] / shares[:, 1], [2.5, 97.5])
    return float(low), float(high)
