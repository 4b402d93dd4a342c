"""Position and speed of a tracked vehicle: one Kalman filter for each direction.

State: position in m and its rate in m/s. The unknown acceleration is white noise (Bar-Shalom, Li
and Kirubarajan, Estimation with Applications to Tracking and Navigation, section 6.2.2: the
discretised continuous white noise acceleration model).
"""

import math


class FrameMotion:
    """A constant-velocity filter in one direction."""

    def __init__(
        self,
        position_m: float,
        sigma_m: float,
        stamp_s: float,
        *,
        rate_sigma_m_s: float,
        acceleration_sigma_m_s2: float,
    ) -> None:
        """Start at a measured position, with a rate of 0.

        Args:
            position_m: as measured.
            sigma_m: of `position_m`.
            stamp_s: of the measurement.
            rate_sigma_m_s: of the initial rate.
            acceleration_sigma_m_s2: growth of the rate's sigma in one second.
        """
        self._position_m, self._rate_m_s = position_m, 0.0
        # The symmetric covariance: of the position, of both, of the rate.
        self._pp, self._pr, self._rr = sigma_m**2, 0.0, rate_sigma_m_s**2
        self._acceleration_variance = acceleration_sigma_m_s2**2
        self._stamp_s = stamp_s

    @property
    def position_m(self) -> float:
        """Position at the time of the last prediction or measurement."""
        return self._position_m

    @property
    def rate_m_s(self) -> float:
        """Change of the position."""
        return self._rate_m_s

    @property
    def position_sigma_m(self) -> float:
        """One standard deviation."""
        return math.sqrt(self._pp)

    @property
    def rate_sigma_m_s(self) -> float:
        """One standard deviation."""
        return math.sqrt(self._rr)

    def predict(self, stamp_s: float) -> None:
        """Predict to `stamp_s`; an earlier time changes nothing."""
        step_s = stamp_s - self._stamp_s
        if step_s <= 0:
            return
        self._stamp_s = stamp_s
        self._position_m += step_s * self._rate_m_s
        # Intensity chosen so that the rate's sigma grows by one acceleration sigma each second.
        q = self._acceleration_variance
        self._pp += step_s * (2 * self._pr + step_s * self._rr) + q * step_s**3 / 3
        self._pr += step_s * self._rr + q * step_s**2 / 2
        self._rr += q * step_s

    def update(self, position_m: float, sigma_m: float) -> None:
        """Update by a position measured at the time of the last prediction."""
        variance = self._pp + sigma_m**2
        self._correct(position_m - self._position_m, self._pp / variance, self._pr / variance)
        self._rr -= self._pr**2 / variance
        self._pr *= sigma_m**2 / variance
        self._pp *= sigma_m**2 / variance

    def update_rate(self, rate_m_s: float, sigma_m_s: float) -> None:
        """Update by a rate measured at the time of the last prediction."""
        variance = self._rr + sigma_m_s**2
        self._correct(rate_m_s - self._rate_m_s, self._pr / variance, self._rr / variance)
        self._pp -= self._pr**2 / variance
        self._pr *= sigma_m_s**2 / variance
        self._rr *= sigma_m_s**2 / variance

    def move(self, by_m: float, by_m_s: float) -> None:
        """Move position and rate: all measurements so far were by other axes."""
        self._position_m += by_m
        self._rate_m_s += by_m_s

    def disturb(self, rate_variance_m2_s2: float) -> None:
        """Add to the variance of the rate: it has changed by what is not known."""
        self._rr += rate_variance_m2_s2

    def scale(self, factor: float) -> None:
        """Multiply all lengths by `factor`: all measurements so far were in another unit."""
        self._position_m *= factor
        self._rate_m_s *= factor
        self._pp, self._pr, self._rr = (factor**2 * each for each in (self._pp, self._pr, self._rr))

    def _correct(self, innovation: float, position_gain: float, rate_gain: float) -> None:
        self._position_m += position_gain * innovation
        self._rate_m_s += rate_gain * innovation
