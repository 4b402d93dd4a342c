"""Some cars on a long road: rows in the host's lane, in the next one, and in the oncoming one.

Each car follows the one ahead of it by the IDM, the first of a lane drives as it likes, and all
sway about that but those with cruise control. So all cars of a lane move alike, a moment apart.
"""

import math

import numpy as np

from sim_rig.cars.gauss_markov import wandered
from sim_rig.roads.car_following import COMFORTABLE_M_S2, CarFollowing, idm_acceleration
from sim_rig.roads.cars import Array

LENGTH_M, LANE_M = 4.5, 3.5
LANES = (0, 1, 2)
OWN, NEXT, ONCOMING = LANES
LANE_SHARES = (0.4, 0.35, 0.25)
SPACE_M = 12.0
"""Mean by which a gap is at first longer than its driver wishes."""
WISHED_SIGMA = 0.08
"""Of the speeds that drivers wish, as a share."""
CRUISE_SHARE = 0.3
"""Share of the drivers with cruise control."""
SWAY_M_S2, SWAY_S = 0.25, 3.0
"""Sigma of a driver's acceleration beside the IDM's, and for how long it lasts."""
CHANGE_M_S, CHANGE_S = 1.5, 15.0
"""Sigma of the speed that the first driver of a lane wishes, and for how long it lasts."""
MODEL = CarFollowing()


class SparseRoad:
    """The cars, in the order of their lanes, in each the first one first."""

    def __init__(self, vehicles: int, speed_m_s: float, rng: np.random.Generator) -> None:
        """Place the cars.

        Args:
            vehicles: number of cars; at least two are in the host's lane.
            speed_m_s: at which all drive at first.
            rng: source of everything.
        """
        self._rng = rng
        own = max(2, round(LANE_SHARES[OWN] * vehicles))
        others = rng.choice([NEXT, ONCOMING], vehicles - own, p=_shares(LANE_SHARES[NEXT:]))
        self.lanes = np.concatenate([np.full(own, OWN), np.sort(others)])
        self._is_first = np.diff(self.lanes, prepend=-1) > 0
        self.speeds_m_s = np.full(vehicles, speed_m_s)
        gaps_m = (
            MODEL.standing_gap_m + speed_m_s * MODEL.headway_s + rng.exponential(SPACE_M, vehicles)
        )
        travelled_m = -np.cumsum(gaps_m + LENGTH_M)
        starts_m = travelled_m[self._is_first][np.cumsum(self._is_first) - 1]
        self.places_m = travelled_m - starts_m + rng.uniform(-40.0, 40.0, 3)[self.lanes]
        """Along the lane, in its direction."""
        self._wished_m_s = speed_m_s * rng.normal(1.1, WISHED_SIGMA, vehicles)
        self._wished_m_s[self._is_first] = speed_m_s
        self._sways: Array = np.where(rng.random(vehicles) < CRUISE_SHARE, 0.0, SWAY_M_S2)
        self._swayed_m_s2 = np.zeros(vehicles)
        self._changed_m_s = np.zeros(vehicles)

    def advance(self, seconds: float) -> None:
        """Let all cars drive on."""
        draws = self._rng.standard_normal((2, len(self.lanes)))
        self._swayed_m_s2 = wandered(self._swayed_m_s2, self._sways, seconds / SWAY_S, draws[0])
        changes_m_s: Array = np.where(self._is_first, CHANGE_M_S, 0.0)
        self._changed_m_s = wandered(self._changed_m_s, changes_m_s, seconds / CHANGE_S, draws[1])
        accelerations = idm_acceleration(
            self.speeds_m_s,
            np.maximum(self._wished_m_s + self._changed_m_s, 1.0),
            np.maximum(self.gaps_m, 0.5),
            np.where(self._is_first, 0.0, self.speeds_m_s - np.roll(self.speeds_m_s, 1)),
            COMFORTABLE_M_S2,
            MODEL,
        )
        before_m_s = self.speeds_m_s
        faster_m_s = (accelerations + self._swayed_m_s2) * seconds
        self.speeds_m_s = np.maximum(before_m_s + faster_m_s, 0.0)
        self.places_m = self.places_m + seconds * (before_m_s + self.speeds_m_s) / 2.0

    @property
    def gaps_m(self) -> Array:
        """To the car ahead; infinite for the first of a lane."""
        apart_m = np.roll(self.places_m, 1) - self.places_m - LENGTH_M
        return np.where(self._is_first, math.inf, apart_m)

    def offsets_m(self, host: int) -> Array:
        """Where all cars are for one of the host's lane: (cars, 2), ahead and to the right."""
        signs = np.where(self.lanes == ONCOMING, -1.0, 1.0)
        ahead_m = signs * self.places_m - self.places_m[host]
        return np.stack([ahead_m, -LANE_M * self.lanes], axis=1)


def _shares(weights: tuple[float, ...]) -> list[float]:
    return [each / sum(weights) for each in weights]
