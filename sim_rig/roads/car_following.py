"""The intelligent driver model (Treiber, Hennecke, Helbing, Phys. Rev. E 62, 2000)."""

import numpy as np
from pydantic import Field

from onboard.settings import Settings
from sim_rig.roads.cars import Array

COMFORTABLE_M_S2 = 3.0
"""Comfortable deceleration b of the IDM."""


class CarFollowing(Settings):
    """IDM parameters that all drivers share."""

    acceleration_m_s2: float = Field(2.1, gt=0.0, le=10.0)
    """IDM's a."""
    hardest_deceleration_m_s2: float = Field(8.0, gt=0.0, le=15.0)
    """Limit of the braking, in an emergency too."""
    headway_s: float = Field(1.2, ge=0.0, le=5.0)
    """IDM's T."""
    standing_gap_m: float = Field(2.0, gt=0.0, le=10.0)
    """IDM's s0."""


def idm_acceleration(  # noqa: PLR0917 (the arguments of the formula, in its order)
    speed: Array,
    wished_speed: Array,
    gap: Array,
    closing_speed: Array,
    comfortable_deceleration: Array | float,
    model: CarFollowing,
) -> Array:
    """Acceleration of the IDM, m/s^2; all arrays broadcast.

    Args:
        speed: m/s.
        wished_speed: desired speed v0, m/s.
        gap: bumper to bumper, m, positive; infinite without a lead.
        closing_speed: m/s.
        comfortable_deceleration: b, m/s^2.
        model: the other parameters.
    """
    most = model.acceleration_m_s2
    dynamic = speed * closing_speed / (2.0 * np.sqrt(most * comfortable_deceleration))
    wished_gap = model.standing_gap_m + np.maximum(speed * model.headway_s + dynamic, 0.0)
    acceleration = most * (1.0 - (speed / wished_speed) ** 4 - (wished_gap / gap) ** 2)
    result: Array = np.clip(acceleration, -model.hardest_deceleration_m_s2, most)
    return result
