"""Metres east and north of a point near the car, from WGS 84 latitude and longitude.

Every car has its own frame. Messages carry its origin in degrees, and metres east and north of it;
a receiver maps the sender's frame to its own by a rotation and a translation.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from onboard.kinematics.arrays import Array

_SEMI_MAJOR_M = 6378137.0
_FLATTENING = 1 / 298.257223563
_ECCENTRICITY_2 = _FLATTENING * (2 - _FLATTENING)


@dataclass(frozen=True, slots=True)
class LocalFrame:
    """The plane that touches the ellipsoid at its origin; x is east, y is north.

    A point 5 km away is placed to within 1 cm in the distance from the origin, and the frames of
    two cars 5 km apart map to each other to within 1 cm.
    """

    latitude_deg: float
    longitude_deg: float

    def position_m(self, latitude_deg: float, longitude_deg: float) -> Array:
        """Place a point of the ellipsoid: (2) east, north."""
        latitude, longitude = math.radians(self.latitude_deg), math.radians(self.longitude_deg)
        there = _earth_centred(latitude_deg, longitude_deg)
        here = _earth_centred(self.latitude_deg, self.longitude_deg)
        x, y, z = there[0] - here[0], there[1] - here[1], there[2] - here[2]
        outwards = math.cos(longitude) * x + math.sin(longitude) * y
        return np.array(
            [
                -math.sin(longitude) * x + math.cos(longitude) * y,
                -math.sin(latitude) * outwards + math.cos(latitude) * z,
            ]
        )

    def mapping_from(self, other: "LocalFrame") -> tuple[Array, Array]:
        """Rotation (2, 2) and translation (2) of positions in `other` into this frame.

        Covariances and velocities are only rotated: meridians converge.
        """
        shift = self.position_m(other.latitude_deg, other.longitude_deg)
        apart_deg = (other.longitude_deg - self.longitude_deg + 180) % 360 - 180
        mean_latitude = math.radians((self.latitude_deg + other.latitude_deg) / 2)
        angle = math.radians(apart_deg) * math.sin(mean_latitude)
        cos, sin = math.cos(angle), math.sin(angle)
        # In the northern hemisphere, north of a frame farther east is turned to the west.
        return np.array([[cos, -sin], [sin, cos]]), shift


@lru_cache(maxsize=1024)
def _earth_centred(latitude_deg: float, longitude_deg: float) -> tuple[float, float, float]:
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    sin = math.sin(latitude)
    normal_m = _SEMI_MAJOR_M / math.sqrt(1 - _ECCENTRICITY_2 * sin * sin)
    across = normal_m * math.cos(latitude)
    return (
        across * math.cos(longitude),
        across * math.sin(longitude),
        normal_m * (1 - _ECCENTRICITY_2) * sin,
    )
