"""Regions in which a certificate is valid (IEEE 1609.2-2022, 6.4.18): read, not enforced."""

from dataclasses import dataclass

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


@dataclass(frozen=True, slots=True)
class RectangularRegion:
    """A rectangle along meridians and parallels."""

    north_west: TwoDLocation
    south_east: TwoDLocation


@dataclass(frozen=True, slots=True)
class PolygonalRegion:
    """A polygon."""

    corners: tuple[TwoDLocation, ...]


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
