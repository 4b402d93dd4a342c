"""A host vehicle of a study with two alarms alone: EEBL, and hard braking ahead.

Roads are straight and lead north. Receivers have errors of their own, which last as long as those
of satellites and reflections do.
"""

import math
from collections.abc import Sequence

import numpy as np

from onboard.kinematics.units import KM_H
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import (
    PathHistory,
    PathHistoryPoint,
    VehicleEventFlags,
    VehicleSafetyExtensions,
)
from onboard.observations import Speed
from onboard.risk.alarm import Assessment
from onboard.risk.braking_ahead import BrakingAhead
from onboard.risk.bsm_data import DEFAULT_LENGTH_M, DEFAULT_WIDTH_M, BsmDataStore
from onboard.risk.eebl import EmergencyElectronicBrakeLights
from onboard.risk.path_ahead import PathAhead
from onboard.risk.settings import RiskSettings
from onboard.risk.situation import Situation
from onboard.sensors.host_state import HostState
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from sim_rig.cars.gauss_markov import wandered
from sim_rig.roads.cars import Array
from sim_rig.roads.earth import to_degrees

BIAS_S = 60.0
"""For how long a receiver's error lasts."""
NOISE_M, NOISE_M_S = 0.2, 0.1
"""White errors of positions and velocities on either axis."""
HISTORY_M = 200.0
"""Length of a path history."""

State = tuple[float, float, float, float]
"""East and north in m, and in m/s, by a receiver."""


class Receivers:
    """The GNSS receivers of all cars."""

    def __init__(self, cars: int, bias_sigma_m: float, rng: np.random.Generator) -> None:
        """Start with a bias of each.

        Args:
            cars: their number.
            bias_sigma_m: of what two cars do not have in common, on either axis.
            rng: source of all errors.
        """
        self._sigma_m, self._rng = bias_sigma_m, rng
        self._bias_m = rng.normal(0.0, bias_sigma_m, (cars, 2))

    def advance(self, seconds: float) -> None:
        """Let the biases change."""
        draws = self._rng.standard_normal(self._bias_m.shape)
        self._bias_m = wandered(self._bias_m, self._sigma_m, seconds / BIAS_S, draws)

    def state(self, car: int, east_m: float, north_m: float, north_m_s: float) -> State:
        """Return what a car's receiver says of its place and velocity."""
        east, north, to_east, to_north = self._rng.standard_normal(4).tolist()
        bias_east_m, bias_north_m = self._bias_m[car].tolist()
        return (
            east_m + bias_east_m + NOISE_M * east,
            north_m + bias_north_m + NOISE_M * north,
            NOISE_M_S * to_east,
            north_m_s + NOISE_M_S * to_north,
        )

    @property
    def sigma_m(self) -> float:
        """Of a position, as receivers report it."""
        return math.hypot(self._sigma_m, NOISE_M)


class CautionHost:
    """Takes speeds and BSMs, and says of which vehicles' braking its driver is cautioned."""

    def __init__(self, sigma_m: float) -> None:
        """Start at rest; `sigma_m` is that of all positions."""
        self._sigma_m = sigma_m
        settings = RiskSettings()
        self._applications = EmergencyElectronicBrakeLights(settings), BrakingAhead(settings)
        self._host, self._path, self._data = HostState(), PathAhead(), BsmDataStore()
        self._others: dict[str, PerceivedObject] = {}

    def receive_bsm(
        self, car: int, speed_m_s: float, now: float, *, place: State | None, brakes: bool = False
    ) -> None:
        """Take a BSM.

        Args:
            car: number of its sender.
            speed_m_s: that it says.
            now: the time.
            place: of the sender; `None` if it has no receiver. It matters while a car brakes.
            brakes: whether the hard braking flag is set.
        """
        name = car.to_bytes(4)
        latitude_deg, longitude_deg, safety = None, None, None
        if brakes:
            history = None
            if place is not None:
                latitude_deg, longitude_deg = to_degrees(*place[:2])
                self._others[name.hex()] = self._object(name.hex(), ObjectSource.BSM, place, now)
                history = _straight_history(place)
            safety = VehicleSafetyExtensions(VehicleEventFlags.HARD_BRAKING, history)
        core = CoreData(0, name, None, latitude_deg, longitude_deg, speed_m_s=speed_m_s)
        self._data.receive_bsm(BasicSafetyMessage(core, safety), now)

    def brakings_ahead(self, speed_m_s: float, place: State | None, now: float) -> set[int]:
        """Return the cars of whose hard braking the driver is cautioned or warned now.

        Args:
            speed_m_s: the own one on the bus.
            place: the own one; `None` without a receiver.
            now: the time.
        """
        self._data.drop_old(now)
        self._host.receive_observation(Speed(now, speed_m_s, KM_H, "study"))
        situation = Situation(
            now,
            self._host,
            (DEFAULT_LENGTH_M, DEFAULT_WIDTH_M),
            {},
            self._data,
            self._path,
            None,
            None if place is None else self._object("host", ObjectSource.HOST, place, now),
            [] if place is None else list(self._others.values()),
        )
        assessed = [each for alarm in self._applications for each in alarm.assess(situation)]
        self._others.clear()
        return {int(each.reasons[0].name, 16) for each in assessed if isinstance(each, Assessment)}

    def _object(self, name: str, source: ObjectSource, state: State, now: float) -> PerceivedObject:
        variances = [self._sigma_m**2] * 2 + [NOISE_M_S**2] * 2
        rows = tuple(map(tuple, np.diag(variances).tolist()))
        return PerceivedObject(now, name, source, state, rows, 0.0, frozenset())


def shown(speeds_m_s: Array, scales: Array) -> Sequence[float]:
    """Return what OBD says of true speeds."""
    speeds: list[float] = (np.round(speeds_m_s * scales / KM_H) * KM_H).tolist()
    return speeds


def _straight_history(place: State) -> PathHistory:
    """Of a car that has driven straight on."""
    east_m, north_m, _, north_m_s = place
    back_m = math.copysign(HISTORY_M, north_m_s)
    latitude_deg, longitude_deg = to_degrees(east_m, north_m)
    then_deg = to_degrees(east_m, north_m - back_m)
    point = PathHistoryPoint(then_deg[0] - latitude_deg, then_deg[1] - longitude_deg, None, 1.0)
    return PathHistory(None, None, (point,))
