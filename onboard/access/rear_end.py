"""Whether a car runs into the one ahead when both brake."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def tolerable_lag_s(
    gap_m: Array,
    lead_speed_m_s: float | Array,
    speed_m_s: float | Array,
    lead_m_s2: Array,
    own_m_s2: Array,
) -> Array:
    """How much later than the lead car the follower may begin to brake, and just not touch it.

    The later it begins, the nearer it comes, so it collides exactly if it lags by more. If it
    brakes harder, the nearest moment may be while both still move, at equal speeds; else it is when
    both stand. Negative where the follower would have to begin first; by how much is exact for
    equal speeds only. All arguments broadcast; the follower moves.
    """
    closing_m_s = np.subtract(speed_m_s, lead_speed_m_s)
    harder_m_s2 = np.subtract(own_m_s2, lead_m_s2)
    ways_m = 0.5 * np.square(lead_speed_m_s) / lead_m_s2 - 0.5 * np.square(speed_m_s) / own_m_s2
    standing_s = (gap_m + ways_m) / speed_m_s
    root = np.maximum(harder_m_s2, 0.0) * (closing_m_s**2 + 2.0 * gap_m * lead_m_s2) / own_m_s2
    moving_s = (np.sqrt(root) - closing_m_s) / lead_m_s2
    # Speeds are equal at (closing + own lag) / harder, and that must be before the lead stops.
    meet = lead_m_s2 * (closing_m_s + own_m_s2 * moving_s) < harder_m_s2 * lead_speed_m_s
    lag_s: Array = np.where((harder_m_s2 > 0.0) & meet, moving_s, standing_s)
    return lag_s
