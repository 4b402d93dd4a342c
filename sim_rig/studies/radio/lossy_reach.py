"""Radio of a study without channel access: who is in reach receives, unless its copy is lost."""

import numpy as np
from numpy.typing import NDArray

from sim_rig.roads.cars import Array


class LossyReach:
    """Decides who receives each broadcast."""

    def __init__(self, reach_m: float, loss: float, rng: np.random.Generator) -> None:
        """Start with a range, the probability that one receiver loses a message, and its source."""
        self.reach_m = reach_m
        self._loss = loss
        self._rng = rng

    def received(self, apart_m: Array) -> NDArray[np.bool_]:
        """Whether each radio receives a broadcast.

        Each has a draw, in reach or not, so that the range does not change other losses.

        Args:
            apart_m: (n,) from the sender; infinite for the sender itself.
        """
        kept: NDArray[np.bool_] = self._rng.random(len(apart_m)) >= self._loss
        return kept & (apart_m <= self.reach_m)
