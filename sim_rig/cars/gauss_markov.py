"""Errors that change slowly: a first-order Gauss-Markov process of constant variance."""

import math

from onboard.kinematics.arrays import Array


class GaussMarkov:
    """How such errors go on from one instant to the next."""

    def __init__(self, period_s: float, correlation_s: float) -> None:
        """Take the time between two instants, and that in which the correlation falls to 1/e."""
        self._kept = math.exp(-period_s / correlation_s)
        self._renewed = math.sqrt(1.0 - self._kept**2)

    def advanced(self, errors: Array, fresh: Array) -> Array:
        """Return the errors at the next instant.

        Args:
            errors: the present ones.
            fresh: as many independent ones, drawn from the same distribution.
        """
        return self._kept * errors + self._renewed * fresh
