"""Factors to SI units, for codecs and texts only; everything else is in SI units."""

KM_H = 1 / 3.6
"""One kilometre per hour in m/s."""

MPH = 0.44704
"""One mile per hour in m/s (exact, international mile)."""

KNOT = 1852 / 3600
"""One knot in m/s (exact, international nautical mile)."""

STANDARD_GRAVITY_M_S2 = 9.80665
"""One g in m/s^2 (ISO 80000-3)."""
