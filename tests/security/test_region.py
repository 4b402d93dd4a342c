"""Regions of certificates: what is inside, and how they are encoded."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.security.oer import OerReader
from onboard.security.region import (
    CircularRegion,
    GeographicRegion,
    IdentifiedRegion,
    PolygonalRegion,
    RectangularRegion,
    TwoDLocation,
    encode_region,
    is_in,
    read_region,
)
from onboard.security.security_services import Opened

MUNICH = TwoDLocation(48.1, 11.5)
NEAR = TwoDLocation(48.1 + 900.0 / 111_195, 11.5)
FAR = TwoDLocation(48.1 + 1100.0 / 111_195, 11.5)
FIJI = RectangularRegion(TwoDLocation(-16.0, 177.0), TwoDLocation(-19.0, -178.0))
TRIANGLE = PolygonalRegion(
    (TwoDLocation(48.0, 11.0), TwoDLocation(49.0, 11.5), TwoDLocation(48.0, 12.0))
)


@pytest.mark.parametrize(
    ("region", "place", "inside"),
    [
        (None, FAR, True),
        (CircularRegion(MUNICH, 1000), NEAR, True),
        (CircularRegion(MUNICH, 1000), FAR, False),
        ((FIJI,), TwoDLocation(-18.0, 179.9), True),
        ((FIJI,), TwoDLocation(-18.0, -179.9), True),
        ((FIJI,), TwoDLocation(-18.0, -177.0), False),
        ((FIJI,), TwoDLocation(-20.0, 179.0), False),
        ((FIJI, RectangularRegion(FAR, MUNICH)), MUNICH, True),
        (TRIANGLE, MUNICH, True),
        (TRIANGLE, TwoDLocation(48.9, 11.1), False),
        (TRIANGLE, TwoDLocation(47.9, 11.5), False),
        (PolygonalRegion(()), MUNICH, False),
        ((IdentifiedRegion(840),), MUNICH, True),
    ],
)
def test_a_place_is_inside_or_not(
    region: GeographicRegion | None, place: TwoDLocation, *, inside: bool
) -> None:
    assert is_in(place, region) == inside


places = st.builds(
    TwoDLocation,
    st.integers(-900_000_000, 900_000_000).map(lambda tenths: tenths / 1e7),
    st.integers(-1_799_999_999, 1_800_000_000).map(lambda tenths: tenths / 1e7),
)
rectangles = st.builds(RectangularRegion, places, places)


@given(
    st.one_of(
        st.builds(CircularRegion, places, st.integers(0, 65_535)),
        st.lists(rectangles, min_size=1, max_size=4).map(tuple),
        st.builds(PolygonalRegion, st.lists(places, min_size=3, max_size=6).map(tuple)),
    )
)
def test_a_region_is_read_as_it_was_encoded(region: GeographicRegion) -> None:
    assert read_region(OerReader(encode_region(region))) == region


def test_a_country_is_only_read() -> None:
    with pytest.raises(ValueError, match="only read"):
        encode_region((IdentifiedRegion(840),))


@pytest.mark.parametrize(
    ("said", "known", "valid"),
    [
        (None, None, True),
        (None, FAR, False),
        (None, NEAR, True),
        (NEAR, FAR, True),
        (FAR, NEAR, False),
    ],
)
def test_a_message_is_valid_in_all_regions_of_its_signer_where_its_header_says_it_was_made(
    said: TwoDLocation | None, known: TwoDLocation | None, *, valid: bool
) -> None:
    regions = (CircularRegion(MUNICH, 5000), CircularRegion(MUNICH, 1000))

    assert Opened(b"", b"signer 1", 0.0, regions, said).is_valid_at(known) == valid
