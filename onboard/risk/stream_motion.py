"""Whether the host vehicle drives as a vehicle on the air did some seconds before.

What happens to a row of vehicles, each repeats after the one ahead of it. So the speed of a vehicle
ahead in the lane is the own one some seconds later, and that of one behind some seconds before. Two
samples a second of both, over the last minute, are compared at all such lags. The evidence is a
generalised likelihood ratio (van Trees 1968, section 2.5): the variance of what is left at the best
lag ahead, against that at the best lag behind, and against that of the own speed by itself. And
mean speeds are alike in a row, while other lanes are faster or slower.

At constant speeds only the means are left, which tell no more than that the vehicle is near.
"""

import math
from collections import deque
from collections.abc import Mapping

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from onboard.kinematics.arrays import Array

SAMPLE_S = 0.5
WINDOW = 120
"""Samples that are compared."""
LAGS = 40
"""Samples by which a vehicle is ahead, or behind, at most: ten vehicles at 2 s each."""
LEAST = 20
"""Samples without which nothing is compared."""
INDEPENDENT_S = 8.0
"""Time after which a difference of two speeds is another one."""
VARIANCE = 0.02
"""Of a difference of two speeds in steps of 1 km/h, in m^2/s^2."""
MEANS_M_S, SPEEDOMETERS = 0.2, 0.01
"""Sigma of the difference of two mean speeds in one row: constant, and as a share of the speed."""
LANES_M_S = 1.5
"""The same of two lanes."""
WEIGHT, BOUND = 0.5, 2.5
"""Of the evidence, since lanes of one road are no strangers to each other: with it, most brakings
are judged rightly (`sim-rig study braking-ahead`). An imitation of the own speed is no proof."""


class StreamMotion:
    """Speeds of the host vehicle and of all vehicles on the air."""

    def __init__(self) -> None:
        """Know no speeds."""
        self._sampled_at = -math.inf
        self._own_m_s: deque[float] = deque(maxlen=WINDOW + LAGS)
        self._others_m_s: dict[str, deque[float]] = {}

    def receive_speeds(
        self, own_m_s: float | None, others_m_s: Mapping[str, float], now: float
    ) -> None:
        """Take all present speeds, of which two a second count; whoever has none is forgotten.

        Args:
            own_m_s: of the host vehicle; `None` begins anew.
            others_m_s: by name.
            now: seconds on the cores' clock.
        """
        if now - self._sampled_at < SAMPLE_S - 1e-6:
            return
        if own_m_s is None or now - self._sampled_at > 2.0 * SAMPLE_S:
            self._own_m_s.clear()
            self._others_m_s.clear()
        self._sampled_at = now
        if own_m_s is None:
            return
        self._own_m_s.append(own_m_s)
        before = self._others_m_s
        self._others_m_s = {}
        for name, speed_m_s in others_m_s.items():
            speeds_m_s = before.get(name)
            if speeds_m_s is None:
                speeds_m_s = deque(maxlen=WINDOW + LAGS)
            speeds_m_s.append(speed_m_s)
            self._others_m_s[name] = speeds_m_s

    def log_ratio(self, name: str) -> float:
        """Logarithm of the likelihood ratio that a vehicle is ahead in the row; 0 if not known."""
        other = np.array(self._others_m_s.get(name, ()))
        if len(other) < LEAST:
            return 0.0
        own = np.array(self._own_m_s)[-len(other) :]
        ahead, samples = _unexplained(own, other)
        behind, _ = _unexplained(other, own)
        alone = float(np.var(own))
        times = samples * SAMPLE_S / INDEPENDENT_S
        by_lag = 0.5 * times * math.log((min(alone, behind) + VARIANCE) / (ahead + VARIANCE))
        apart_m_s = float(np.mean(own - other))
        row = MEANS_M_S**2 + (SPEEDOMETERS * float(np.mean(own))) ** 2 + alone / times
        lanes = row + LANES_M_S**2
        by_means = 0.5 * (math.log(lanes / row) - apart_m_s**2 * (1.0 / row - 1.0 / lanes))
        return min(max(WEIGHT * (by_lag + by_means), -BOUND), BOUND)


def _unexplained(later: Array, earlier: Array) -> tuple[float, int]:
    """Least variance that is left if one speed repeats the other, and of how many samples."""
    lags = min(LAGS, len(later) // 2)
    samples = min(WINDOW, len(later) - lags)
    windows = sliding_window_view(earlier, samples)[-1 - lags : -1]
    return float(np.var(later[-samples:] - windows, axis=1).min()), samples
