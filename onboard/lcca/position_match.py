"""Whether a vehicle on the air is where the lead is, if both vehicles have a position.

GNSS errors of several metres last for minutes, so only the latest position counts, once, and its
evidence is bounded: it excludes vehicles elsewhere, and does not tell lanes apart.
"""

import math

REFERENCE_M, SHAPE_M = 4.5, 3.0
"""From the camera to the plate, plus this, is from one vehicle's reference to the other's; and the
sigma of that."""
ACROSS_M = 3.0
"""Sigma across the lane: of the lead's place in a bend, and of the heading."""
GNSS_M = 5.0
"""Sigma of GNSS positions in streets, beyond the one that receivers report."""
ROW_M = 300.0
"""Extent of a row, ahead or behind."""
ALONG_ROAD_M, ACROSS_ROAD_M = 1000.0, 30.0
"""Extent of the places where another vehicle in range may be."""
LEAST, MOST = -5.0, 4.0
"""Bounds of the evidence."""


def position_log_ratio(ahead_m: float, right_m: float, sigma_m: float, gap_m: float) -> float:
    """Return the logarithm of the likelihood ratio that this vehicle is the lead.

    Args:
        ahead_m: of the host vehicle, by both positions.
        right_m: of the host vehicle's heading.
        sigma_m: of either, as the receivers report it.
        gap_m: to the lead, by the camera.
    """
    along_m = math.hypot(sigma_m, GNSS_M, SHAPE_M)
    across_m = math.hypot(sigma_m, GNSS_M, ACROSS_M)
    off = ((ahead_m - gap_m - REFERENCE_M) / along_m) ** 2 + (right_m / across_m) ** 2
    here = -0.5 * off - math.log(2.0 * math.pi * along_m * across_m)
    return min(max(here + math.log(ALONG_ROAD_M * ACROSS_ROAD_M), LEAST), MOST)


def row_log_ratio(ahead_m: float, right_m: float, sigma_m: float) -> float:
    """Return the same for a vehicle being anywhere in the lane, ahead or behind.

    Args:
        ahead_m: of the host vehicle, by both positions.
        right_m: of the host vehicle's heading.
        sigma_m: of either, as the receivers report it.
    """
    across_m = math.hypot(sigma_m, GNSS_M, ACROSS_M)
    here = -0.5 * (right_m / across_m) ** 2 - math.log(math.sqrt(2.0 * math.pi) * across_m)
    along = -math.log(2.0 * ROW_M) if abs(ahead_m) < ROW_M else -math.inf
    return min(max(here + along + math.log(ALONG_ROAD_M * ACROSS_ROAD_M), LEAST), MOST)
