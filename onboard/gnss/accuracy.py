"""Horizontal accuracy of a fix, as one standard deviation on each axis.

A receiver reports it (GST, gpsd's error estimates), or the dilution of precision. HDOP is the ratio
of the horizontal error (both axes together) to the range error:

    sigma = HDOP * range error / sqrt(2)
"""

import math
from collections.abc import Mapping

RANGE_ERROR_M = 4.0
"""Standard deviation of a pseudorange (UERE) without corrections."""

UNKNOWN_HDOP = 2.0
"""Assumed HDOP if the receiver reports none: a street with a part of the sky."""

RANGE_ERROR_BY_QUALITY: Mapping[int, float] = {2: 0.5, 4: 0.01, 5: 0.1, 6: 3.0}
"""Range error relative to a fix without corrections, by GGA quality: 2 differential, 4 RTK fixed, 5
RTK float, 6 dead reckoning."""


def known_dop(dop: float | None) -> float | None:
    """A dilution of precision, for which receivers write 0 or 99 if they do not know it."""
    return dop if dop is not None and 0 < dop < 99 else None


def sigma_from_hdop_m(hdop: float | None, quality: int | None) -> float:
    """Sigma of a fix of this GGA `quality`; unknown values are `None`."""
    error_m = RANGE_ERROR_M * RANGE_ERROR_BY_QUALITY.get(quality or 0, 1.0)
    return (UNKNOWN_HDOP if hdop is None else hdop) * error_m / math.sqrt(2)


def sigma_of_axes_m(north_m: float, east_m: float) -> float:
    """One sigma for both axes, from the mean of their variances."""
    return math.sqrt((north_m**2 + east_m**2) / 2)
