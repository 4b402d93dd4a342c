"""What the bus and the camera of a host say in the studies of `Identification`."""

import numpy as np

from onboard.kinematics.arrays import Array
from onboard.kinematics.units import KM_H
from sim_rig.cars.camera_view import FPS
from sim_rig.cars.gauss_markov import wandered

SPEED_STEP_M_S = KM_H
"""Resolution of OBD speeds."""
SPEEDOMETER = (1.006, 0.006)
"""What OBD says of the true speed: mean and sigma."""
CLOSING_SIGMA_M_S, CLOSING_ERROR_S = 0.3, 0.48
"""Sigma of the errors of the closing speed, and the time in which they fall to 1/e."""


def shown_m_s(speeds_m_s: Array, scales: Array) -> Array:
    """Return what the buses (n,) say of these speeds; `scales` are drawn by `SPEEDOMETER`."""
    return np.round(scales * speeds_m_s / SPEED_STEP_M_S) * SPEED_STEP_M_S


class ClosingError:
    """The error of the closing speed that a camera measures of one lead."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Begin with none."""
        self._rng = rng
        self._error_m_s = np.zeros(1)

    def next_m_s(self) -> float:
        """Return that of the next image."""
        draw, passed = self._rng.standard_normal(1), 1 / FPS / CLOSING_ERROR_S
        self._error_m_s = wandered(self._error_m_s, CLOSING_SIGMA_M_S, passed, draw)
        return float(self._error_m_s[0])
