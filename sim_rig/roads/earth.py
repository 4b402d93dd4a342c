"""Geodetic position of the scenarios' plane."""

import math

from onboard.kinematics.local_frame import LocalFrame

ORIGIN = LocalFrame(48.1, 11.5)
"""Origin of every scenario; neither at the equator nor at a pole."""
ORIGIN_HEIGHT_M = 520.0
"""Height of the plane above the ellipsoid."""
_METRES_A_DEGREE = 111_200.0


def to_degrees(x_m: float, y_m: float) -> tuple[float, float]:
    """Latitude and longitude, deg, of a position east and north of the origin, m (Newton)."""
    latitude_deg, longitude_deg = ORIGIN.latitude_deg, ORIGIN.longitude_deg
    for _ in range(4):
        east_m, north_m = ORIGIN.position_m(latitude_deg, longitude_deg)
        latitude_deg += (y_m - north_m) / _METRES_A_DEGREE
        shrunk = _METRES_A_DEGREE * math.cos(math.radians(latitude_deg))
        longitude_deg += (x_m - east_m) / shrunk
    return latitude_deg, longitude_deg
