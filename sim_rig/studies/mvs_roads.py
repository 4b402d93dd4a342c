"""The road on which the accuracy of MVS is measured: cars that move just as the filter assumes."""

import math

import numpy as np
from typing_extensions import override

from sim_rig.roads.cars import Array, Cars, Traffic

LANES_M = (-10.5, -6.5, -2.5, 2.5, 6.5, 10.5)
STEP_S = 0.01
SPEED_M_S = 12.0


class SixLaneRoad(Traffic):
    """Three lanes each way at 12 m/s; every car strays about its place by white acceleration.

    A spring and a damper keep it there: its acceleration is -0.25 x - 0.7 v + noise of density q
    along the lane, with x the distance from its place and v the difference from 12 m/s.
    """

    def __init__(
        self,
        cars_per_lane: int,
        spacing_m: float,
        duration_s: float,
        q: float,
        rng: np.random.Generator,
    ) -> None:
        """Drive for `duration_s`; q in m^2/s^3."""
        n = len(LANES_M) * cars_per_lane
        self.names = tuple(f"car{number}" for number in range(n))
        self._direction = np.repeat([1.0 if y < 0 else -1.0 for y in LANES_M], cars_per_lane)
        offsets = np.repeat(rng.uniform(0.0, spacing_m, len(LANES_M)), cars_per_lane)
        places = np.tile((np.arange(cars_per_lane) - cars_per_lane / 2) * spacing_m, len(LANES_M))
        self._places, self._lanes = places + offsets, np.repeat(LANES_M, cars_per_lane)
        start = np.stack([rng.normal(0, 1.5, n), rng.normal(0, 0.9, n)])
        self._strays, self._speeds = _stray(start, duration_s, q, rng, spring=0.25, damper=0.7)
        self._across = self._strays * 0.0, self._speeds * 0.0

    @override
    def cars_at(self, at_s: float) -> Cars:
        """All of them, always."""
        step = round(at_s / STEP_S)
        along = SPEED_M_S * step * STEP_S + self._strays[step]
        across_m, across_m_s = (strayed[step] for strayed in self._across)
        along_m_s = SPEED_M_S + self._speeds[step]
        n = len(self.names)
        return Cars(
            at_s,
            self.names,
            np.stack([self._direction * (self._places + along), self._lanes + across_m], axis=1),
            np.arctan2(across_m_s, self._direction * along_m_s),
            np.hypot(along_m_s, across_m_s),
            np.zeros(n),
            np.full(n, 4.5),
            np.full(n, 1.8),
        )


class FreeCars(SixLaneRoad):
    """Cars on such a road that nothing keeps in their places: they stray along it and across.

    That is no traffic, but exactly what the filter takes it for.
    """

    def __init__(
        self,
        cars_per_lane: int,
        spacing_m: float,
        duration_s: float,
        q: float,
        rng: np.random.Generator,
    ) -> None:
        """As `SixLaneRoad`, the lanes three times as wide, since nobody keeps his."""
        super().__init__(cars_per_lane, spacing_m, duration_s, q, rng)
        self._lanes = 3.0 * self._lanes
        still = np.zeros((2, len(self.names)))
        self._strays, self._speeds = _stray(still, duration_s, q, rng)
        self._across = _stray(still, duration_s, q, rng)


def _stray(
    start: Array,
    duration_s: float,
    q: float,
    rng: np.random.Generator,
    *,
    spring: float = 0.0,
    damper: float = 0.0,
) -> tuple[Array, Array]:
    """Distances and speeds of N cars under white acceleration of density q, a row for each step.

    `start` (2, N) is the first row of either.
    """
    steps, n = math.ceil(duration_s / STEP_S) + 2, start.shape[1]
    strays, speeds = np.zeros((steps, n)), np.zeros((steps, n))
    strays[0], speeds[0] = start
    for step in range(1, steps):
        pull = -spring * strays[step - 1] - damper * speeds[step - 1]
        noise = rng.normal(0, math.sqrt(q * STEP_S), n)
        speeds[step] = speeds[step - 1] + pull * STEP_S + noise
        strays[step] = strays[step - 1] + speeds[step] * STEP_S
    return strays, speeds


def states_of(cars: Cars) -> Array:
    """(N, 4): px, py, vx, vy."""
    return np.hstack([cars.middle_m, cars.velocity_m_s])
