"""Two vehicles in lanes of one road with bends, with the receivers' errors."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from onboard.bsm_transmission.path_history import PathHistoryKeeper
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData, VehicleSize
from onboard.messages.bsm_safety import VehicleEventFlags, VehicleSafetyExtensions
from onboard.observations import Position
from onboard.risk.monitor import RiskMonitor
from onboard.risk.settings import RiskSettings
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

FRAME = LocalFrame(48.1, 11.5)
OTHER_ID = bytes.fromhex("0a0b0c0d")
LANE_M = 3.5
STEP_M = 0.5
NOISE_M, NOISE_M_S = 0.2, 0.1
"""White errors of the receivers, on either axis."""


class Road:
    """The middle of a lane by its curvature, positive to the left."""

    def __init__(self, curvature_1_m: Callable[[float], float], length_m: float = 900.0) -> None:
        self._way_m = np.arange(0.0, length_m, STEP_M)
        self._heading = np.cumsum([curvature_1_m(way) * STEP_M for way in self._way_m])
        self._x = np.cumsum(np.cos(self._heading)) * STEP_M
        self._y = np.cumsum(np.sin(self._heading)) * STEP_M

    def at(self, way_m: float, left_m: float) -> tuple[float, float, float]:
        """East, north, and heading from east to north."""
        x, y, heading = (
            float(np.interp(way_m, self._way_m, each)) for each in (self._x, self._y, self._heading)
        )
        return x - left_m * math.sin(heading), y + left_m * math.cos(heading), heading


@dataclass
class Scene:
    """The other is `ahead_m` ahead and `left_m(way)` to the left of the host's lane."""

    road: Road
    ahead_m: float
    left_m: Callable[[float], float]
    speed_m_s: float = 16.0
    seed: int = 1

    def drive(self, until_m: float) -> tuple[RiskMonitor, PerceivedObject, PerceivedObject, float]:
        """Drive up to `until_m`, then let the other brake hard for one BSM."""
        rng = np.random.default_rng(self.seed)
        monitor, keeper = RiskMonitor(RiskSettings(), 4.8, 1.8), PathHistoryKeeper()
        steps = round(until_m / self.speed_m_s * 10.0)
        fixes = [self._fixes(rng, k / 10.0) for k in range(steps + 1)]
        for own, other in fixes:
            monitor.receive_event(own, own.stamp_s)
            keeper.receive_position(other)
        (own, other), now = fixes[-1], steps / 10.0
        safety = VehicleSafetyExtensions(VehicleEventFlags.HARD_BRAKING, keeper.history(now))
        core = CoreData(
            1, OTHER_ID, latitude_deg=other.latitude_deg, longitude_deg=other.longitude_deg,
            size=VehicleSize(width_m=1.8, length_m=4.5),
        )  # fmt: skip
        monitor.receive_bsm(BasicSafetyMessage(core, safety), now)
        known = as_object(other, OTHER_ID.hex(), ObjectSource.BSM)
        return monitor, as_object(own, "own", ObjectSource.HOST), known, now

    def _fixes(self, rng: np.random.Generator, now: float) -> tuple[Position, Position]:
        own = self._fix(rng, now, self.speed_m_s * now, 0.0)
        other_way_m = self.speed_m_s * now + self.ahead_m
        return own, self._fix(rng, now, other_way_m, self.left_m(other_way_m))

    def _fix(self, rng: np.random.Generator, now: float, way_m: float, left_m: float) -> Position:
        return noisy_fix(self.road.at(way_m, left_m), self.speed_m_s, now, rng)


def noisy_fix(
    at: tuple[float, float, float], speed_m_s: float, now: float, rng: np.random.Generator
) -> Position:
    """Fix of a receiver at a place of `Road.at`."""
    x, y, heading = at
    place = np.array([x, y]) + rng.normal(0.0, NOISE_M, 2)
    velocity = speed_m_s * np.array([math.cos(heading), math.sin(heading)])
    east, north = velocity + rng.normal(0.0, NOISE_M_S, 2)
    latitude, longitude = FRAME.latitude_deg, FRAME.longitude_deg
    for _ in range(3):
        off = place - FRAME.position_m(latitude, longitude)
        latitude += off[1] / 111_200.0
        longitude += off[0] / (111_300.0 * math.cos(math.radians(latitude)))
    return Position(
        now, latitude, longitude, None, 0.5, math.hypot(east, north), math.atan2(east, north)
    )


def as_object(fix: Position, name: str, source: ObjectSource) -> PerceivedObject:
    """Perceived object of a fix."""
    east_m, north_m = FRAME.position_m(fix.latitude_deg, fix.longitude_deg).tolist()
    assert fix.speed_m_s is not None
    assert fix.course_rad is not None
    velocity = (
        fix.speed_m_s * math.sin(fix.course_rad),
        fix.speed_m_s * math.cos(fix.course_rad),
    )
    rows = tuple(map(tuple, np.diag([0.25] * 4).tolist()))
    return PerceivedObject(
        fix.stamp_s, name, source, (east_m, north_m, *velocity), rows, 0.0, frozenset()
    )
