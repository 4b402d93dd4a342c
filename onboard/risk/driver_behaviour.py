"""Distribution of a driver's acceleration: uniform (eq. 5) or triangular (figure 3).

Both are given by their limits, which may differ from car to car; all fields broadcast.
"""

from dataclasses import dataclass

import numpy as np

from onboard.kinematics.arrays import Array


@dataclass(frozen=True, slots=True)
class Uniform:
    """Every acceleration between the limits is as likely as any other (section III-D)."""

    lowest_m_s2: Array
    highest_m_s2: Array

    def cdf(self, acceleration_m_s2: Array) -> Array:
        """The probability of a lower acceleration; the argument may be infinite."""
        clipped = np.clip(acceleration_m_s2, self.lowest_m_s2, self.highest_m_s2)
        return (clipped - self.lowest_m_s2) / (self.highest_m_s2 - self.lowest_m_s2)

    def quantile(self, probability: Array) -> Array:
        """The acceleration that is not exceeded with `probability`."""
        return self.lowest_m_s2 + probability * (self.highest_m_s2 - self.lowest_m_s2)


@dataclass(frozen=True, slots=True)
class Triangular:
    """The present acceleration is the likeliest, the limits have probability 0 (section III-E)."""

    lowest_m_s2: Array
    present_m_s2: Array
    highest_m_s2: Array

    def cdf(self, acceleration_m_s2: Array) -> Array:
        """The probability of a lower acceleration; the argument may be infinite."""
        low, high = self.lowest_m_s2, self.highest_m_s2
        mode, span = np.clip(self.present_m_s2, low, high), high - low
        a = np.clip(acceleration_m_s2, low, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            rising = (a - low) ** 2 / (span * (mode - low))
            falling = 1.0 - (high - a) ** 2 / (span * (high - mode))
        return np.where(a < mode, rising, np.where(a < high, falling, 1.0))

    def quantile(self, probability: Array) -> Array:
        """The acceleration that is not exceeded with `probability`."""
        low, high = self.lowest_m_s2, self.highest_m_s2
        mode, span = np.clip(self.present_m_s2, low, high), high - low
        return np.where(
            probability * span < mode - low,
            low + np.sqrt(probability * span * (mode - low)),
            high - np.sqrt((1.0 - probability) * span * (high - mode)),
        )


Behaviour = Uniform | Triangular
