"""Motion of one scenario car as a trace recorded it."""

import math

import numpy as np

from sim_rig.roads.recording import STEP_S, Trajectory
from sim_rig.roads.road import CarState


class TrajectoryDrive:
    """Linear between the samples; before the first and after the last one, the car stands."""

    def __init__(self, trajectory: Trajectory, height_m: float) -> None:
        """Follow a trajectory.

        Args:
            trajectory: of the car.
            height_m: of the car, which traces do not tell.
        """
        self._trajectory = trajectory
        self._height_m = height_m
        self._at_s = (trajectory.first + np.arange(len(trajectory))) * STEP_S
        steps_m = np.hypot(*np.diff(trajectory.middle_m, axis=0).T)
        self._driven_m = np.concatenate([[0.0], np.cumsum(steps_m)])
        self._acceleration_m_s2 = np.diff(trajectory.speed_m_s) / STEP_S

    def state(self, at_s: float) -> CarState:
        """State of the car at `at_s`."""
        it = self._trajectory
        begin_s, end_s = float(self._at_s[0]), float(self._at_s[-1])
        drives = begin_s <= at_s <= end_s
        step = min(int((min(max(at_s, begin_s), end_s) - begin_s) / STEP_S), len(it) - 2)
        share = min(max(at_s, begin_s), end_s) / STEP_S - it.first - step
        x_m, y_m = (1 - share) * it.middle_m[step] + share * it.middle_m[step + 1]
        heading_rad = (1 - share) * it.heading_rad[step] + share * it.heading_rad[step + 1]
        speed_m_s = (1 - share) * it.speed_m_s[step] + share * it.speed_m_s[step + 1]
        driven_m = (1 - share) * self._driven_m[step] + share * self._driven_m[step + 1]
        return CarState(
            x_m=float(x_m),
            y_m=float(y_m),
            heading_rad=math.pi / 2 - float(heading_rad),
            elevation_m=0.0,
            front_m=float(driven_m),
            speed_m_s=float(speed_m_s) if drives else 0.0,
            acceleration_m_s2=float(self._acceleration_m_s2[step]) if drives else 0.0,
            length_m=it.length_m,
            width_m=it.width_m,
            height_m=self._height_m,
        )
