"""Nakagami fading of the received power."""

import numpy as np

from sim_rig.propagation.path_loss import Array


class Fading:
    """Nakagami fading: what arrives, as a factor of the mean power, from a gamma distribution."""

    def __init__(self, nakagami_m: float | None, rng: np.random.Generator) -> None:
        """`nakagami_m` is the shape, 1 for Rayleigh; None for a channel that does not fade."""
        self._m = nakagami_m
        self._rng = rng

    def faded(self, mean_power: Array) -> Array:
        """One draw for each receiver."""
        if self._m is None:
            return mean_power
        if self._m == 1.0:
            return mean_power * self._rng.standard_exponential(len(mean_power))
        return mean_power * (self._rng.standard_gamma(self._m, len(mean_power)) / self._m)
