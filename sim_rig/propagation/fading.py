"""Nakagami fading of the received power."""

import numpy as np

from sim_rig.propagation.path_loss import Array


class Fading:
    """Nakagami fading: received power as a gamma-distributed multiple of the mean power."""

    def __init__(self, nakagami_m: float | None, rng: np.random.Generator) -> None:
        """`nakagami_m` is the shape, 1 for Rayleigh; `None` for a channel without fading."""
        self._m = nakagami_m
        self._rng = rng

    def faded(self, mean_power: Array) -> Array:
        """Received power of one frame at each receiver, mW, from the mean power (receivers,)."""
        if self._m is None:
            return mean_power
        if self._m == 1.0:
            return mean_power * self._rng.standard_exponential(len(mean_power))
        return mean_power * (self._rng.standard_gamma(self._m, len(mean_power)) / self._m)
