"""Where a tracked car is and how it moves: one Kalman filter a direction.

State: position in m and its rate in m/s. The car's acceleration is unknown, taken as white noise
(Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, section
6.2.2: the discretised continuous white noise acceleration model).
"""

import math

import numpy as np
from filterpy.kalman import KalmanFilter


class Motion:
    """Constant velocity, as well as known."""

    def __init__(
        self,
        position_m: float,
        sigma_m: float,
        stamp_s: float,
        *,
        rate_sigma_m_s: float,
        acceleration_sigma_m_s2: float,
    ) -> None:
        """Start at a measured position, at rest but for `rate_sigma_m_s`."""
        self._filter = KalmanFilter(dim_x=2, dim_z=1)
        self._filter.x = np.array([[position_m], [0.0]])
        self._filter.P = np.diag([sigma_m**2, rate_sigma_m_s**2])
        self._filter.H = np.array([[1.0, 0.0]])
        self._acceleration_variance = acceleration_sigma_m_s2**2
        self._stamp_s = stamp_s

    @property
    def position_m(self) -> float:
        """At the time of the last prediction or measurement."""
        return float(self._filter.x[0, 0])

    @property
    def rate_m_s(self) -> float:
        """Change of the position."""
        return float(self._filter.x[1, 0])

    @property
    def position_sigma_m(self) -> float:
        """One standard deviation."""
        return math.sqrt(self._filter.P[0, 0])

    @property
    def rate_sigma_m_s(self) -> float:
        """One standard deviation."""
        return math.sqrt(self._filter.P[1, 1])

    def predict(self, stamp_s: float) -> None:
        """Go on to `stamp_s`; a time that has passed changes nothing."""
        step_s = stamp_s - self._stamp_s
        if step_s <= 0:
            return
        self._stamp_s = stamp_s
        transition = np.array([[1.0, step_s], [0.0, 1.0]])
        # Intensity chosen so that the rate's sigma grows by one acceleration sigma each second.
        noise = self._acceleration_variance * np.array(
            [[step_s**3 / 3, step_s**2 / 2], [step_s**2 / 2, step_s]]
        )
        self._filter.predict(F=transition, Q=noise)

    def update(self, position_m: float, sigma_m: float) -> None:
        """Take in a measurement made at the time of the last prediction."""
        self._filter.update(position_m, R=sigma_m**2)

    def update_rate(self, rate_m_s: float, sigma_m_s: float) -> None:
        """Take in a measurement of the rate, made at the time of the last prediction."""
        self._filter.update(rate_m_s, R=sigma_m_s**2, H=np.array([[0.0, 1.0]]))
