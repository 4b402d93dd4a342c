"""The road on which the accuracy of MVS is measured: cars move as the filter's model assumes."""

import math
from collections.abc import Sequence

import numpy as np
from typing_extensions import override

from sim_rig.roads.cars import Array, Cars, Traffic

LANES_M = (-10.5, -6.5, -2.5, 2.5, 6.5, 10.5)
STEP_S = 0.01
SPEED_M_S = 12.0
Deviations = tuple[Array, Array]
"""In position and speed, (steps, cars) each."""


class SixLaneRoad(Traffic):
    """Three lanes each way at 12 m/s; white acceleration noise moves every car about its position.

    A spring and a damper limit the deviation: the acceleration along the lane is -0.25 x - 0.7 v +
    noise of density q, with x the deviation from the position and v that from 12 m/s.
    """

    lanes_m: Sequence[float] = LANES_M

    def __init__(
        self,
        cars_per_lane: int,
        spacing_m: float,
        duration_s: float,
        q: float,
        rng: np.random.Generator,
    ) -> None:
        """Compute the trajectories of all cars.

        Args:
            cars_per_lane: number of cars in each of the six lanes.
            spacing_m: distance between the undisturbed positions of two cars of a lane.
            duration_s: last time that `cars_at` accepts.
            q: density of the acceleration noise, m^2/s^3.
            rng: source of offsets and noise.
        """
        n = len(self.lanes_m) * cars_per_lane
        self.names = tuple(f"car{number}" for number in range(n))
        self._direction = np.repeat([1.0 if y < 0 else -1.0 for y in self.lanes_m], cars_per_lane)
        offsets = np.repeat(rng.uniform(0.0, spacing_m, len(self.lanes_m)), cars_per_lane)
        positions = np.tile(
            (np.arange(cars_per_lane) - cars_per_lane / 2) * spacing_m, len(self.lanes_m)
        )
        self._positions, self._lanes = positions + offsets, np.repeat(self.lanes_m, cars_per_lane)
        self._along, self._across = self._deviations(n, duration_s, q, rng)

    def _deviations(
        self, cars: int, duration_s: float, q: float, rng: np.random.Generator
    ) -> tuple[Deviations, Deviations]:
        """Deviations along the road, and across it, where there are none."""
        start = np.stack([rng.normal(0, 1.5, cars), rng.normal(0, 0.9, cars)])
        along_m, along_m_s = _noisy_motion(start, duration_s, q, rng, spring=0.25, damper=0.7)
        return (along_m, along_m_s), (along_m * 0.0, along_m_s * 0.0)

    @override
    def cars_at(self, at_s: float) -> Cars:
        """All cars of the road."""
        step = round(at_s / STEP_S)
        along_m, along_m_s = (deviation[step] for deviation in self._along)
        across_m, across_m_s = (deviation[step] for deviation in self._across)
        along_m, along_m_s = SPEED_M_S * step * STEP_S + along_m, SPEED_M_S + along_m_s
        n = len(self.names)
        return Cars(
            at_s,
            self.names,
            np.stack(
                [self._direction * (self._positions + along_m), self._lanes + across_m], axis=1
            ),
            np.arctan2(across_m_s, self._direction * along_m_s),
            np.hypot(along_m_s, across_m_s),
            np.zeros(n),
            np.full(n, 4.5),
            np.full(n, 1.8),
        )


class FreeCars(SixLaneRoad):
    """Cars without spring and damper: they deviate without limit, along the road and across it.

    This is not realistic traffic, but it is exactly the motion model of the filter. Lanes are three
    times as wide, since cars leave them.
    """

    lanes_m = tuple(3.0 * lane_m for lane_m in LANES_M)

    @override
    def _deviations(
        self, cars: int, duration_s: float, q: float, rng: np.random.Generator
    ) -> tuple[Deviations, Deviations]:
        """Deviations along the road, and across it."""
        start = np.zeros((2, cars))
        return _noisy_motion(start, duration_s, q, rng), _noisy_motion(start, duration_s, q, rng)


def _noisy_motion(
    start: Array,
    duration_s: float,
    q: float,
    rng: np.random.Generator,
    *,
    spring: float = 0.0,
    damper: float = 0.0,
) -> Deviations:
    """Deviations in position and speed of N cars under white acceleration noise, a row each step.

    `start` (2, N) is the first row of either.
    """
    steps, n = math.ceil(duration_s / STEP_S) + 2, start.shape[1]
    deviation_m, speeds = np.zeros((steps, n)), np.zeros((steps, n))
    deviation_m[0], speeds[0] = start
    for step in range(1, steps):
        pull = -spring * deviation_m[step - 1] - damper * speeds[step - 1]
        noise = rng.normal(0, math.sqrt(q * STEP_S), n)
        speeds[step] = speeds[step - 1] + pull * STEP_S + noise
        deviation_m[step] = deviation_m[step - 1] + speeds[step] * STEP_S
    return deviation_m, speeds


def states_of(cars: Cars) -> Array:
    """True states (N, 4): px, py, vx, vy."""
    return np.hstack([cars.middle_m, cars.velocity_m_s])
