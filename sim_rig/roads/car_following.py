"""The intelligent driver model (Treiber, Hennecke, Helbing, Phys. Rev. E 62, 2000)."""

import numpy as np
from pydantic import Field

from onboard.settings import Settings
from sim_rig.roads.cars import Array

COMFORTABLE_M_S2 = 3.0
"""IDM's b, where it is the same for all."""


class CarFollowing(Settings):
    """What drivers have in common."""

    acceleration_m_s2: float = Field(2.1, gt=0.0, le=10.0)
    """IDM's a."""
    hardest_deceleration_m_s2: float = Field(8.0, gt=0.0, le=15.0)
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
    """Acceleration in m/s^2; all arguments in m and s, and broadcast.

    `gap` is from bumper to bumper, positive, infinite where nobody is ahead.
    """
    most = model.acceleration_m_s2
    dynamic = speed * closing_speed / (2.0 * np.sqrt(most * comfortable_deceleration))
    wished_gap = model.standing_gap_m + np.maximum(speed * model.headway_s + dynamic, 0.0)
    acceleration = most * (1.0 - (speed / wished_speed) ** 4 - (wished_gap / gap) ** 2)
    result: Array = np.clip(acceleration, -model.hardest_deceleration_m_s2, most)
    return result
