"""Whether a place is in the destination area of a geo-broadcast (EN 302 931 V1.1.1, clause 5)."""

import math

from onboard.its_g5.headers import Area
from onboard.kinematics.local_frame import LocalFrame

CIRCLE, RECTANGLE, ELLIPSE = range(3)
"""Shapes, as subtypes of the packet."""


def is_within(area: Area, shape: int, latitude_deg: float, longitude_deg: float) -> bool:
    """Whether a place is in an area; none is in one without extent.

    Args:
        area: the area.
        shape: its shape.
        latitude_deg: of the place.
        longitude_deg: of the place.
    """
    long_m, short_m = area.distance_a_m, area.distance_b_m
    if shape == CIRCLE:
        short_m = long_m
    if not long_m or not short_m:
        return False
    centre = LocalFrame(area.latitude_deg, area.longitude_deg)
    east_m, north_m = centre.position_m(latitude_deg, longitude_deg)
    angle = math.radians(area.angle_deg)
    along = (north_m * math.cos(angle) + east_m * math.sin(angle)) / long_m
    across = (east_m * math.cos(angle) - north_m * math.sin(angle)) / short_m
    if shape == RECTANGLE:
        return bool(max(abs(along), abs(across)) <= 1.0)
    return bool(math.hypot(along, across) <= 1.0)
