"""Regions in which a certificate is valid (IEEE 1609.2-2022, 6.4.18).

Circles, rectangles and polygons are applied. Countries and their parts are only read: there is no
map of them here.
"""

from dataclasses import dataclass
from itertools import pairwise

from onboard.kinematics.geodesy import distance_m
from onboard.security import oer
from onboard.security.oer import Malformed, OerReader


@dataclass(frozen=True, slots=True)
class TwoDLocation:
    """A point on the ground (WGS-84)."""

    latitude_deg: float
    longitude_deg: float


@dataclass(frozen=True, slots=True)
class CircularRegion:
    """A circle."""

    center: TwoDLocation
    radius_m: int

    def contains(self, place: TwoDLocation) -> bool:
        """Whether a place is in it."""
        center = self.center
        return (
            distance_m(
                center.latitude_deg, center.longitude_deg, place.latitude_deg, place.longitude_deg
            )
            <= self.radius_m
        )


@dataclass(frozen=True, slots=True)
class RectangularRegion:
    """A rectangle along meridians and parallels."""

    north_west: TwoDLocation
    south_east: TwoDLocation

    def contains(self, place: TwoDLocation) -> bool:
        """Whether a place is in it; it may reach over the 180th meridian."""
        from_south = self.south_east.latitude_deg <= place.latitude_deg
        width_deg = (self.south_east.longitude_deg - self.north_west.longitude_deg) % 360.0
        east_deg = (place.longitude_deg - self.north_west.longitude_deg) % 360.0
        return (
            from_south
            and place.latitude_deg <= self.north_west.latitude_deg
            and east_deg <= width_deg
        )


@dataclass(frozen=True, slots=True)
class PolygonalRegion:
    """A polygon."""

    corners: tuple[TwoDLocation, ...]

    def contains(self, place: TwoDLocation) -> bool:
        """Whether a place is in it: a line from there to the north crosses an odd number of sides.

        Sides are straight in degrees; a polygon does not reach over the 180th meridian.
        """
        inside = False
        for one, other in pairwise((*self.corners, *self.corners[:1])):
            if (one.longitude_deg > place.longitude_deg) == (
                other.longitude_deg > place.longitude_deg
            ):
                continue
            share = (place.longitude_deg - one.longitude_deg) / (
                other.longitude_deg - one.longitude_deg
            )
            side_deg = one.latitude_deg + share * (other.latitude_deg - one.latitude_deg)
            inside ^= side_deg > place.latitude_deg
        return inside


@dataclass(frozen=True, slots=True)
class IdentifiedRegion:
    """A country, or some of its regions, by numbers."""

    country: int
    """Of the United Nations (M.49): 840 the United States, 410 Korea."""
    regions: tuple[int, ...] = ()
    """None: the whole country."""
    subregions: tuple[tuple[int, ...], ...] = ()
    """Of each of the regions; none: the whole regions."""


GeographicRegion = (
    CircularRegion | PolygonalRegion | tuple[RectangularRegion, ...] | tuple[IdentifiedRegion, ...]
)


def is_in(place: TwoDLocation, region: GeographicRegion | None) -> bool:
    """Whether a certificate with `region` is valid at a place, as far as that can be told."""
    if region is None:
        return True
    parts = region if isinstance(region, tuple) else (region,)
    return any(isinstance(part, IdentifiedRegion) or part.contains(place) for part in parts)


def encode_region(region: GeographicRegion) -> bytes:
    """Encode a circle, rectangles or a polygon.

    Raises:
        ValueError: a country, which is only read.
    """
    if isinstance(region, CircularRegion):
        radius = region.radius_m.to_bytes(2, "big")
        return oer.choice(0) + _encode_location(region.center) + radius
    if isinstance(region, PolygonalRegion):
        return oer.choice(2) + oer.sequence([_encode_location(each) for each in region.corners])
    rectangles = []
    for each in region:
        if isinstance(each, IdentifiedRegion):
            raise ValueError("regions by country are only read")  # noqa: TRY004 (a valid region)
        rectangles.append(_encode_location(each.north_west) + _encode_location(each.south_east))
    return oer.choice(1) + oer.sequence(rectangles)


def _encode_location(place: TwoDLocation) -> bytes:
    return b"".join(
        round(degrees * 1e7).to_bytes(4, "big", signed=True)
        for degrees in (place.latitude_deg, place.longitude_deg)
    )


def read_region(reader: OerReader) -> GeographicRegion:
    """Read a GeographicRegion. Raises `Malformed`."""
    kind = reader.choice()
    if kind == 0:
        return CircularRegion(_read_location(reader), reader.integer(2))
    if kind == 1:
        return reader.several(_read_rectangle)
    if kind == 2:
        return PolygonalRegion(reader.several(_read_location))
    if kind == 3:
        return reader.several(_read_identified)
    raise Malformed(f"a region of kind {kind}")


def _read_location(reader: OerReader) -> TwoDLocation:
    latitude, longitude = (
        int.from_bytes(reader.take(4), "big", signed=True) / 1e7 for _ in range(2)
    )
    return TwoDLocation(latitude, longitude)


def _read_rectangle(reader: OerReader) -> RectangularRegion:
    return RectangularRegion(_read_location(reader), _read_location(reader))


def _read_identified(reader: OerReader) -> IdentifiedRegion:
    kind = reader.choice()
    country = reader.integer(2)
    if kind == 0:
        return IdentifiedRegion(country)
    if kind == 1:
        return IdentifiedRegion(country, reader.several(OerReader.byte))
    if kind == 2:
        both = reader.several(_read_subregions)
        return IdentifiedRegion(
            country, tuple(region for region, _ in both), tuple(inner for _, inner in both)
        )
    raise Malformed(f"an identified region of kind {kind}")


def _read_subregions(reader: OerReader) -> tuple[int, tuple[int, ...]]:
    return reader.byte(), reader.several(lambda inner: inner.integer(2))
