"""Recorded paths and stops, driven as a car can.

Some traces have cars that stand within a tenth of a second, or turn corners at any speed. Here each
car follows its recorded path at its recorded speed, unless it has to be slower: to brake in time
for its stops and bends, to gain speed after them, and in the bends themselves. It leaves a stop
when the recorded car did, or at once if it arrives later than that.
"""

from dataclasses import replace

import numpy as np

from sim_rig.roads.cars import Array
from sim_rig.roads.paths import DrivePath
from sim_rig.roads.recording import STEP_S, RecordedTraffic, Trajectory

BRAKING_M_S2, GAINING_M_S2, LATERAL_M_S2 = 3.5, 2.5, 3.5
"""The hardest that a car brakes, gains speed and turns."""
_EVERY_M = 0.25
_BEND_M = 2.0
"""Half of the length of road over which a bend is measured."""
_SLOWEST_IN_BEND_M_S = 2.0
"""Corners of a trace can be points."""
_CREEPING_M_S = 0.5
"""A slower car that does not stand is taken to creep at this speed to its stop."""
_ROUNDED_STEPS = 5
"""A driver changes the acceleration over this time, not within an instant."""


def retimed(recording: RecordedTraffic) -> RecordedTraffic:
    """Return the same cars on the same paths with speeds that can be driven."""
    return RecordedTraffic(_retimed(drive) for drive in recording.drives)


def _retimed(drive: Trajectory) -> Trajectory:
    path = DrivePath(drive)
    ways_m = _places_m(path)
    speeds_m_s = _drivable_m_s(ways_m, _wished_m_s(path, ways_m))
    left_s = _left_s(path, ways_m, speeds_m_s)
    return driven_along(path, _driven_m(left_s, ways_m, speeds_m_s), drive.first)


def driven_along(path: DrivePath, ways_m: Array, first: int) -> Trajectory:
    """Return the car of a path at these distances (n,) from its start, smoothed.

    Args:
        path: of the car.
        ways_m: at each step.
        first: the step of the first one.
    """
    driven_m = _rounded(ways_m)
    middle_m, heading_rad = path.places(driven_m)
    return replace(
        path.drive,
        first=first,
        middle_m=middle_m,
        heading_rad=heading_rad,
        speed_m_s=np.maximum(np.gradient(driven_m, STEP_S), 0.0),
    )


def _places_m(path: DrivePath) -> Array:
    """Places along the path (n,), the stops among them."""
    stops_m = [way_m for way_m, _ in path.waits]
    places_m: Array = np.unique([*np.arange(0.0, path.length_m, _EVERY_M), *stops_m, path.length_m])
    return places_m


def _wished_m_s(path: DrivePath, ways_m: Array) -> Array:
    """Speed at each place (n,): the recorded one, or that of the bend; 0 at a stop."""
    bend_1_m = np.maximum.reduce(
        [_curvature_1_m(path, ways_m + by_m) for by_m in (-_BEND_M, 0.0, _BEND_M)]
    )
    in_bend_m_s = np.maximum(np.sqrt(LATERAL_M_S2 / bend_1_m), _SLOWEST_IN_BEND_M_S)
    recorded_m_s = np.array([path.speed_m_s(way_m) for way_m in ways_m])
    wished_m_s: Array = np.maximum(np.minimum(recorded_m_s, in_bend_m_s), _CREEPING_M_S)
    wished_m_s[np.searchsorted(ways_m, [way_m for way_m, _ in path.waits])] = 0.0
    return wished_m_s


def _curvature_1_m(path: DrivePath, ways_m: Array) -> Array:
    """Of the path about each place (n,); not 0, so that it can divide."""
    _, before_rad = path.places(np.maximum(ways_m - _BEND_M, 0.0))
    _, after_rad = path.places(np.maximum(ways_m + _BEND_M, 0.0))
    return np.maximum(np.abs(after_rad - before_rad) / (2.0 * _BEND_M), 1e-6)


def _drivable_m_s(ways_m: Array, wished_m_s: Array) -> Array:
    """The highest speeds (n,), none above the wished one, between which a car can change."""
    gained, braked = 2.0 * GAINING_M_S2 * ways_m, 2.0 * BRAKING_M_S2 * ways_m
    squared = np.minimum.accumulate(wished_m_s**2 - gained) + gained
    squared = np.minimum.accumulate((squared + braked)[::-1])[::-1] - braked
    return np.sqrt(np.maximum(squared, 0.0))


def _left_s(path: DrivePath, ways_m: Array, speeds_m_s: Array) -> Array:
    """When each place is left (n,), since the first one."""
    both_m_s = np.maximum(speeds_m_s[1:] + speeds_m_s[:-1], 1e-3)
    left_s = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(ways_m) / both_m_s)])
    for way_m, until_s in path.waits:
        at = int(np.searchsorted(ways_m, way_m))
        left_s[at:] += max(until_s - path.drive.first * STEP_S - left_s[at], 0.0)
    return left_s


def _driven_m(left_s: Array, ways_m: Array, speeds_m_s: Array) -> Array:
    """The way every `STEP_S`; from place to place the acceleration is constant."""
    at_s = np.arange(0.0, left_s[-1], STEP_S)
    place = np.maximum(np.searchsorted(left_s, at_s, "right") - 1, 0)
    length_m, begin, end = np.diff(ways_m)[place], speeds_m_s[place], speeds_m_s[place + 1]
    takes_s = 2.0 * length_m / np.maximum(begin + end, 1e-3)
    since_s = np.clip(at_s - left_s[place], 0.0, takes_s)
    gained_m_s = (end - begin) * since_s / takes_s
    driven_m: Array = ways_m[place] + (begin + gained_m_s / 2.0) * since_s
    return driven_m


def _rounded(driven_m: Array) -> Array:
    """Moving average of ways (n,), which spreads each change of the acceleration.

    The ends go on as they are.
    """
    half = _ROUNDED_STEPS // 2
    before = driven_m[0] - (driven_m[1] - driven_m[0]) * np.arange(half, 0, -1)
    after = driven_m[-1] + (driven_m[-1] - driven_m[-2]) * np.arange(1, half + 1)
    longer = np.concatenate([before, driven_m, after])
    smooth_m: Array = np.convolve(longer, np.full(_ROUNDED_STEPS, 1.0 / _ROUNDED_STEPS), "valid")
    return smooth_m
