"""Trajectories along the middles of roads, moved into the right lane."""

from dataclasses import replace

import numpy as np

from sim_rig.roads.cars import Array
from sim_rig.roads.recording import RecordedTraffic, Trajectory

_STEPS = 11
_EVERY_M = 0.5
_CORNER_M = 10.0
"""On this much road before and after a corner a car turns: with a radius of some 13 m."""


def keep_right(recording: RecordedTraffic, by_m: float) -> RecordedTraffic:
    """Shift trajectories to the right by `by_m`, and smooth their corners over a second."""
    return RecordedTraffic(_kept_right(drive, by_m) for drive in recording.drives)


def in_right_lane(recording: RecordedTraffic, by_m: float) -> RecordedTraffic:
    """Shift trajectories to the right by `by_m`, on paths that a car can steer.

    Corners are smoothed by distance: smoothed by time, slow cars turn on the spot, and are moved
    back by the shift. Times and stops stay; speeds are to be made anew (`retimed`).
    """
    return RecordedTraffic(_in_right_lane(drive, by_m) for drive in recording.drives)


def _kept_right(drive: Trajectory, by_m: float) -> Trajectory:
    window = min(_STEPS, len(drive))
    middle_m, heading_rad = _shifted(drive.middle_m, drive.heading_rad, window, by_m)
    return replace(drive, middle_m=middle_m, heading_rad=heading_rad)


def _in_right_lane(drive: Trajectory, by_m: float) -> Trajectory:
    at_m = drive.ways_m()
    ways_m = np.arange(0.0, at_m[-1] + _EVERY_M, _EVERY_M)
    path_m = np.stack([np.interp(ways_m, at_m, line) for line in drive.middle_m.T], axis=1)
    path_rad = np.interp(ways_m, at_m, drive.heading_rad)
    window = 2 * round(_CORNER_M / _EVERY_M) + 1
    path_m, path_rad = _shifted(path_m, path_rad, window, by_m)
    middle_m = np.stack([np.interp(at_m, ways_m, line) for line in path_m.T], axis=1)
    heading_rad = np.interp(at_m, ways_m, path_rad)
    return replace(drive, middle_m=middle_m, heading_rad=heading_rad)


def _shifted(middle_m: Array, heading_rad: Array, window: int, by_m: float) -> tuple[Array, Array]:
    """Smooth places (n, 2) and headings (n,) over so many samples, and shift them."""
    ahead = _averaged(np.stack([np.cos(heading_rad), np.sin(heading_rad)], axis=1), window)
    smooth_rad = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    right = np.stack([np.sin(smooth_rad), -np.cos(smooth_rad)], axis=1)
    return _averaged(middle_m, window) + by_m * right, smooth_rad


def _averaged(samples: Array, window: int) -> Array:
    """Moving average (n, 2), with smaller windows at the ends."""
    half = window // 2
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(samples, axis=0)])
    at = np.arange(len(samples))
    reach = np.minimum(half, np.minimum(at, len(samples) - 1 - at))
    averaged: Array = (sums[at + reach + 1] - sums[at - reach]) / (2 * reach + 1)[:, None]
    return averaged
