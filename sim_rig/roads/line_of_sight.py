"""Buildings that block the line of sight between cars."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sim_rig.roads.cars import Array

Blocked = Callable[[Array, Array], NDArray[np.bool_]]
"""Whether the lines of sight between positions (..., 2) and (..., 2), m, are blocked."""


class Corners:
    """Buildings in the four corners of a crossing at the origin: where |x| and |y| are large."""

    def __init__(self, from_m: float) -> None:
        """`from_m`: distance of the buildings from the middle of either road."""
        self._from_m = from_m

    def __call__(self, here: Array, there: Array) -> NDArray[np.bool_]:
        """Whether each line of sight goes through one of the four buildings."""
        blocked = np.zeros(np.broadcast_shapes(here.shape, there.shape)[:-1], dtype=bool)
        for east in (-1.0, 1.0):
            for north in (-1.0, 1.0):
                side = np.array([east, north])
                first, last = np.broadcast_arrays(side * here, side * there)
                change = last - first
                with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                    passes = (self._from_m - first) / change
                inside = first > self._from_m
                enters = np.where(change > 0.0, passes, np.where(inside, -np.inf, np.inf))
                leaves = np.where(
                    change < 0.0, passes, np.where(inside | (change > 0.0), np.inf, -np.inf)
                )
                begin = np.maximum(enters.max(axis=-1), 0.0)
                blocked |= begin < np.minimum(leaves.min(axis=-1), 1.0)
        return blocked
