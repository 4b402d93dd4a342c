"""Distances on the earth."""

import math

EARTH_RADIUS_M = 6_371_000.0


def distance_m(
    latitude_deg: float, longitude_deg: float, other_latitude_deg: float, other_longitude_deg: float
) -> float:
    """Distance of two points on a locally flat sphere, with an error below 1 % up to 10 km.

    Args:
        latitude_deg: latitude of the one point.
        longitude_deg: its longitude.
        other_latitude_deg: latitude of the other point.
        other_longitude_deg: its longitude.
    """
    north = math.radians(other_latitude_deg - latitude_deg)
    turn_deg = (other_longitude_deg - longitude_deg + 180.0) % 360.0 - 180.0
    east = math.radians(turn_deg) * math.cos(math.radians(latitude_deg))
    return EARTH_RADIUS_M * math.hypot(north, east)


def point_ahead_deg(
    latitude_deg: float, longitude_deg: float, heading_rad: float, ahead_m: float
) -> tuple[float, float]:
    """Return latitude and longitude of a point some metres from another, as near as `distance_m`.

    Args:
        latitude_deg: latitude of the other point.
        longitude_deg: its longitude.
        heading_rad: direction to the point, clockwise from north.
        ahead_m: distance of the point; negative behind the other one.
    """
    north_deg = math.degrees(ahead_m * math.cos(heading_rad) / EARTH_RADIUS_M)
    east_deg = math.degrees(ahead_m * math.sin(heading_rad) / EARTH_RADIUS_M)
    turned_deg = longitude_deg + east_deg / math.cos(math.radians(latitude_deg))
    return latitude_deg + north_deg, (turned_deg + 180.0) % 360.0 - 180.0
