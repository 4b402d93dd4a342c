"""Model of a GNSS receiver with its errors, as NMEA sentences.

Positions have a slowly varying bias, partly common to all receivers of a run, and white noise;
speed and course come from a noisy velocity. Fixes are at multiples of the fix interval in UTC, as
of real receivers, and are sent after a latency as GGA, GST and RMC.
"""

import math
from collections.abc import Callable

import numpy as np

from onboard.kinematics.arrays import Array
from sim_rig.cars.gauss_markov import wandered
from sim_rig.cars.nmea_sentences import Fix, sentences
from sim_rig.roads.earth import ORIGIN_HEIGHT_M, to_degrees
from sim_rig.roads.road import CarState
from sim_rig.scenario.sensor_settings import ReceiverSettings

_AXES = np.array([1.0, 1.0, 2.0])
"""Scale of the errors east, north and up."""


class GnssReceiver:
    """One car's receiver, without I/O."""

    def __init__(
        self,
        settings: ReceiverSettings,
        state_at: Callable[[float], CarState | None],
        utc_offset_s: float,
        rng: np.random.Generator,
        shared_rng: np.random.Generator,
    ) -> None:
        """Start at the first fix time at or after 0.

        Args:
            settings: the errors.
            state_at: true state of the car at a `now`; `None` without reception.
            utc_offset_s: UTC minus `now`, s.
            rng: source of this receiver's own errors.
            shared_rng: source of the common errors; each receiver has a copy with the same seed.
        """
        self._settings = settings
        self._state_at = state_at
        self._utc_offset_s = utc_offset_s
        self._rng = rng
        self._shared_rng = shared_rng
        self._fixes = math.ceil(utc_offset_s * settings.rate_hz)
        """Number of the next fix, counted from 1970."""
        self._bias_m = self._fresh_m()
        self._times = 1.0 / settings.rate_hz / settings.bias_time_s

    def skip_to(self, now: float) -> None:
        """Make no fix before `now`."""
        self._fixes = math.ceil((now + self._utc_offset_s) * self._settings.rate_hz)

    def get_timer(self) -> float:
        """Return when the next fix is sent."""
        return self._fix_at + self._settings.latency_s

    def bytes_to_send(self, now: float) -> bytes:
        """Return the sentences of a fix; empty if none is due."""
        if now < self.get_timer():
            return b""
        at, self._fixes = self._fix_at, self._fixes + 1
        settings, noise = self._settings, self._rng.standard_normal(5)
        self._bias_m = wandered(self._bias_m, 1.0, self._times, self._fresh_m())
        state = self._state_at(at)
        if state is None:
            return b""
        scatter_m = settings.noise_sigma_m * _AXES * noise[:3]
        east_m, north_m, up_m = self._bias_m + scatter_m
        velocity_m_s = (
            state.speed_m_s * math.sin(state.heading_rad) + settings.speed_sigma_m_s * noise[3],
            state.speed_m_s * math.cos(state.heading_rad) + settings.speed_sigma_m_s * noise[4],
        )
        return self._sentences(
            round((self._fixes - 1) / settings.rate_hz, 2),
            to_degrees(state.x_m + east_m, state.y_m + north_m),
            ORIGIN_HEIGHT_M + state.elevation_m + up_m,
            velocity_m_s,
        )

    def _fresh_m(self) -> Array:
        """Draw an independent bias, (3,) east, north, up, m."""
        shared = self._settings.bias_shared
        drawn = math.sqrt(shared) * self._shared_rng.standard_normal(3)
        drawn += math.sqrt(1.0 - shared) * self._rng.standard_normal(3)
        bias_m: Array = self._settings.bias_sigma_m * _AXES * drawn
        return bias_m

    @property
    def _fix_at(self) -> float:
        return self._fixes / self._settings.rate_hz - self._utc_offset_s

    def _sentences(
        self,
        utc_s: float,
        place_deg: tuple[float, float],
        height_m: float,
        velocity_m_s: tuple[float, float],
    ) -> bytes:
        latitude_deg, longitude_deg = map(float, place_deg)
        fix = Fix(
            utc_s=utc_s,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            height_m=height_m,
            sigma_m=math.hypot(self._settings.bias_sigma_m, self._settings.noise_sigma_m),
            speed_m_s=math.hypot(*velocity_m_s),
            course_deg=math.degrees(math.atan2(*velocity_m_s)) % 360.0,
        )
        return sentences(fix)
