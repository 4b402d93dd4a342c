"""A dense road with three lanes each way, whose cars follow one another.

In each lane all follow the first by the IDM and sway about that (`sparse_road.py`). The first ones
of a direction slow down and speed up together to a share, as where a motorway is busy: the lanes
beside the own one then move much as it does.
"""

import math

import numpy as np

from sim_rig.cars.gauss_markov import wandered
from sim_rig.roads.car_following import COMFORTABLE_M_S2, CarFollowing, idm_acceleration
from sim_rig.roads.cars import Array
from sim_rig.studies.lcca.sparse_road import (
    CRUISE_SHARE,
    LANE_M,
    LENGTH_M,
    SWAY_M_S2,
    SWAY_S,
)

LANES, CARS = 3, 40
"""Each way; in each."""
SPACE_M = 8.0
"""Mean by which a gap is at first longer than its driver wishes: 25 cars a kilometre and lane."""
LANE_SIGMA_M_S = 1.0
"""Of the mean speeds of lanes."""
WAVES = ((1.5, 60.0), (1.0, 15.0))
"""Sigma of the changes of a first car's speed in m/s, and for how long one lasts in s."""
ONCOMING_M = 1600.0
"""Way after which the same cars come towards a host again."""
COMMON = 0.5
"""Share of their variance that all lanes of a direction have in common."""
IN_LANE_M, IN_LANE_S = 0.25, 10.0
"""Sigma of a car's place across its lane, and for how long it lasts."""
MODEL = CarFollowing()


class DenseRoad:
    """The cars of one direction after the other, in each lane the first one first."""

    def __init__(self, speed_m_s: float, rng: np.random.Generator) -> None:
        """Place the cars, which all drive at almost `speed_m_s`; `rng` is the source of all."""
        self._rng = rng
        cars = 2 * LANES * CARS
        self.lanes = np.arange(cars) // CARS
        """From 0: those of the first direction from left to right, and then of the other."""
        self._is_first = np.arange(cars) % CARS == 0
        self.speeds_m_s = np.full(cars, speed_m_s)
        gaps_m = MODEL.standing_gap_m + speed_m_s * MODEL.headway_s + rng.exponential(SPACE_M, cars)
        travelled_m = -np.cumsum(gaps_m + LENGTH_M)
        starts_m = travelled_m[self._is_first] + rng.uniform(-40.0, 40.0, 2 * LANES)
        self.places_m = travelled_m - starts_m[self.lanes]
        """Along the lane, in its direction."""
        self._wished_m_s = speed_m_s * rng.normal(1.15, 0.08, cars)
        self._wished_m_s[self._is_first] = rng.normal(speed_m_s, LANE_SIGMA_M_S, 2 * LANES)
        self._sways: Array = np.where(rng.random(cars) < CRUISE_SHARE, 0.0, SWAY_M_S2)
        self._swayed_m_s2 = np.zeros(cars)
        self._common = np.zeros((len(WAVES), 2))
        self._of_lane = np.zeros((len(WAVES), 2 * LANES))
        self._across_m = rng.normal(0.0, IN_LANE_M, cars)

    def advance(self, seconds: float) -> None:
        """Let all cars drive on."""
        rng, cars = self._rng, len(self.lanes)
        self._swayed_m_s2 = wandered(
            self._swayed_m_s2, self._sways, seconds / SWAY_S, rng.standard_normal(cars)
        )
        self._across_m = wandered(
            self._across_m, IN_LANE_M, seconds / IN_LANE_S, rng.standard_normal(cars)
        )
        wished_m_s = self._wished_m_s.copy()
        for wave, (sigma_m_s, lasts_s) in enumerate(WAVES):
            for kind in (self._common, self._of_lane):
                draws = rng.standard_normal(kind.shape[1])
                kind[wave] = wandered(kind[wave], sigma_m_s, seconds / lasts_s, draws)
            common = np.repeat(self._common[wave], LANES)
            wished_m_s[self._is_first] += (
                math.sqrt(COMMON) * common + math.sqrt(1.0 - COMMON) * self._of_lane[wave]
            )
        before_m_s = self.speeds_m_s
        accelerations = idm_acceleration(
            before_m_s,
            np.maximum(wished_m_s, 1.0),
            np.maximum(self._gaps_m, 0.5),
            np.where(self._is_first, 0.0, before_m_s - np.roll(before_m_s, 1)),
            COMFORTABLE_M_S2,
            MODEL,
        )
        faster_m_s = (accelerations + self._swayed_m_s2) * seconds
        self.speeds_m_s = np.maximum(before_m_s + faster_m_s, 0.0)
        self.places_m = self.places_m + seconds * (before_m_s + self.speeds_m_s) / 2.0

    @property
    def _gaps_m(self) -> Array:
        apart_m = np.roll(self.places_m, 1) - self.places_m - LENGTH_M
        return np.where(self._is_first, math.inf, apart_m)

    def offsets_m(self, host: int) -> Array:
        """Where all cars are for a host of the first direction: (cars, 2), ahead and to the right.

        The cars that come towards it come again and again.
        """
        is_oncoming = self.lanes >= LANES
        ahead_m = np.where(is_oncoming, -self.places_m, self.places_m) - self.places_m[host]
        passed_m = np.mod(ahead_m + ONCOMING_M / 2.0, ONCOMING_M) - ONCOMING_M / 2.0
        right = np.where(is_oncoming, self.lanes - 2 * LANES, self.lanes) - self.lanes[host]
        right_m = right * LANE_M + self._across_m - self._across_m[host]
        return np.stack([np.where(is_oncoming, passed_m, ahead_m), right_m], axis=1)
