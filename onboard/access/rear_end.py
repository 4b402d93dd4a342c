"""Rear-end crashes of two vehicles that brake one after the other, in closed form."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def tolerable_lag_s(
    gap_m: Array,
    lead_speed_m_s: float | Array,
    speed_m_s: float | Array,
    lead_m_s2: Array,
    follower_m_s2: Array,
) -> Array:
    """Return the longest time after the lead at which the follower can brake without a crash.

    The follower crashes exactly if it brakes later than this. The smallest gap occurs when both
    have stopped or, if the follower brakes harder, possibly while both move at equal speeds.
    Negative values, where the follower has to brake first, are exact for equal speeds only. All
    arguments broadcast.

    Args:
        gap_m: from the follower's front to the lead's rear when the lead begins to brake.
        lead_speed_m_s: speed of the lead at that time.
        speed_m_s: speed of the follower at that time, above 0.
        lead_m_s2: deceleration of the lead, above 0.
        follower_m_s2: deceleration of the follower, above 0.
    """
    closing_m_s = np.subtract(speed_m_s, lead_speed_m_s)
    harder_m_s2 = np.subtract(follower_m_s2, lead_m_s2)
    braking_difference_m = (
        0.5 * np.square(lead_speed_m_s) / lead_m_s2 - 0.5 * np.square(speed_m_s) / follower_m_s2
    )
    standing_s = (gap_m + braking_difference_m) / speed_m_s
    root = np.maximum(harder_m_s2, 0.0) * (closing_m_s**2 + 2.0 * gap_m * lead_m_s2) / follower_m_s2
    moving_s = (np.sqrt(root) - closing_m_s) / lead_m_s2
    # Speeds become equal at (closing + follower * lag) / harder; valid only before the lead stops.
    is_moving = lead_m_s2 * (closing_m_s + follower_m_s2 * moving_s) < harder_m_s2 * lead_speed_m_s
    lag_s: Array = np.where((harder_m_s2 > 0.0) & is_moving, moving_s, standing_s)
    return lag_s
