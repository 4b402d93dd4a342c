"""Encoding, decoding, printing and documentation follow from one declaration."""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Annotated, Any

import asn1tools
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.messages.fields import (
    Boolean,
    Choice,
    Chosen,
    ExtensibleEnumerated,
    FixedPoint,
    Ia5String,
    Integer,
    OctetString,
    OpenEnumerated,
    Unsigned,
)
from onboard.messages.record import Record
from tests.messages.strategies import records
from tests.typed import a


class Weather(Enum):
    DRY = 1
    WET = 2


@dataclass(frozen=True, slots=True)
class Sample:
    """Every kind of field of a fixed width, none of them on a byte boundary."""

    count: Annotated[int, Unsigned(3)]
    speed_m_s: Annotated[float | None, FixedPoint(13, 0.02, "m/s", highest=8190, unavailable=8191)]
    offset_m: Annotated[float, FixedPoint(11, 0.1, "m", lowest=-1000, highest=1000)]
    name: Annotated[bytes, OctetString(3)]
    weather: Annotated[Weather | int, OpenEnumerated(Weather, 5)]


RECORD = Record(Sample)
SAMPLE = Sample(5, 27.78, -3.2, b"abc", Weather.WET)


def test_fields_follow_without_padding_most_significant_bit_first() -> None:
    # 101 | 0010101101101 (1389) | 11111100000 (-32) | 'a' 'b' 'c' | 00010
    bits = "101_0010101101101_11111100000_011000010110001001100011_00010"
    assert RECORD.encode(SAMPLE) == int(bits, 2).to_bytes(7)
    assert RECORD.size_bytes == 7


@given(records(RECORD))
def test_every_declared_message_survives_encoding_and_decoding(sample: Sample) -> None:
    assert RECORD.decode(RECORD.encode(sample)) == sample


@given(st.binary(min_size=7, max_size=7))
def test_any_bytes_are_refused_or_encoded_again_to_the_same_bits(data: bytes) -> None:
    try:
        sample = RECORD.decode(data)
    except DecodeError:
        return
    assert RECORD.encode(sample) == data
    assert set(RECORD.as_dict(sample)) == set(RECORD.fields)


@pytest.mark.parametrize("size", range(7))
def test_a_truncated_message_is_too_short(size: int) -> None:
    with pytest.raises(DecodeError, match=r"too_short: \d bytes instead of 7"):
        RECORD.decode(RECORD.encode(SAMPLE)[:size])


def test_a_longer_message_has_trailing_bytes() -> None:
    with pytest.raises(DecodeError) as refusal:
        RECORD.decode(RECORD.encode(SAMPLE) + b"\0")
    assert refusal.value.reason == "trailing_bytes"


def test_a_quantity_beyond_the_range_is_sent_as_its_end() -> None:
    fast = Sample(0, 400.0, -1e9, b"abc", 0)
    assert RECORD.decode(RECORD.encode(fast)) == Sample(0, 8190 * 0.02, -100.0, b"abc", 0)
    assert a(FixedPoint, RECORD.fields["speed_m_s"]).to_raw(float("inf")) == 8190


def test_an_unavailable_quantity_stays_unavailable() -> None:
    unknown = Sample(0, None, 0.0, b"abc", Weather.DRY)
    assert RECORD.decode(RECORD.encode(unknown)) == unknown


@pytest.mark.parametrize(
    ("field", "sample"),
    [
        ("count", Sample(8, 0.0, 0.0, b"abc", 1)),
        ("count", Sample(-1, 0.0, 0.0, b"abc", 1)),
        ("speed_m_s", Sample(0, float("nan"), 0.0, b"abc", 1)),
        ("offset_m", Sample(0, 0.0, None, b"abc", 1)),  # type: ignore[arg-type]
        ("name", Sample(0, 0.0, 0.0, b"ab", 1)),
        ("weather", Sample(0, 0.0, 0.0, b"abc", 32)),
    ],
)
def test_a_value_that_cannot_be_encoded_is_a_value_error_that_names_the_field(
    field: str, sample: Sample
) -> None:
    with pytest.raises(ValueError, match=rf"^Sample\.{field}: "):
        RECORD.encode(sample)


def test_a_code_of_a_later_version_survives_decoding_and_printing() -> None:
    later = RECORD.decode(RECORD.encode(Sample(0, 0.0, 0.0, b"abc", 9)))
    assert later.weather == 9
    assert RECORD.as_dict(later)["weather"] == "unknown_9"
    assert RECORD.encode(later) == RECORD.encode(Sample(0, 0.0, 0.0, b"abc", 9))


def test_printing_gives_json_values() -> None:
    assert RECORD.as_dict(SAMPLE) == {
        "count": 5,
        "speed_m_s": 27.78,
        "offset_m": -3.2,
        "name": "616263",
        "weather": "wet",
    }


def test_the_documentation_table_is_made_from_the_declaration() -> None:
    assert RECORD.table().splitlines() == [
        "    field                       bits each  content",
        "    count                       3          0 to 7",
        "    speed_m_s                   13         m/s: 0 to 163.8 by 0.02; unavailable: 8191",
        "    offset_m                    11         m: -100 to 100 by 0.1",
        "    name                        24         3 bytes",
        "    weather                     5          1 dry, 2 wet",
    ]


def test_fields_of_the_same_declaration_share_a_row_of_the_documentation_table() -> None:
    @dataclass(frozen=True)
    class Position:
        east_m: Annotated[int, Unsigned(8)]
        north_m: Annotated[int, Unsigned(8)]
        up_m: Annotated[int, Unsigned(7)]

    assert Record(Position).table(first=1).splitlines()[1:] == [
        "    north_m                     8          0 to 255",
        "    up_m                        7          0 to 127",
    ]
    assert "    east_m, north_m             8          0 to 255" in Record(Position).table()


def test_a_message_is_whole_bytes() -> None:
    @dataclass(frozen=True)
    class Odd:
        count: Annotated[int, Unsigned(7)]

    with pytest.raises(TypeError, match="Odd is 7 bits long, not whole bytes"):
        _ = Record(Odd).size_bytes


class Colour(Enum):
    RED = 0
    GREEN = 1


@dataclass(frozen=True)
class Painted:
    colour: Annotated[Colour | int, ExtensibleEnumerated(Colour)]
    size: Annotated[Chosen, Choice({"number": Integer(0, 7)}, extensible=True)]
    name: Annotated[str, Ia5String(1, 63)]
    is_wet: Annotated[bool, Boolean()]


PAINTED = Record(Painted)
OF_TOMORROW = asn1tools.compile_string(
    """Painted DEFINITIONS AUTOMATIC TAGS ::= BEGIN
    Painted ::= SEQUENCE {
      colour ENUMERATED { red, green, ..., blue, grey },
      size CHOICE { number INTEGER (0..7), ..., text OCTET STRING, weight INTEGER (0..255) },
      name IA5String (SIZE (1..63)),
      wet BOOLEAN
    }
    END""",
    "uper",
)


@pytest.mark.parametrize(
    ("theirs", "ours", "printed"),
    [
        (
            {"colour": "green", "size": ("number", 5), "name": "a", "wet": True},
            Painted(Colour.GREEN, Chosen("number", 5), "a", is_wet=True),
            {"colour": "green", "size": {"number": 5}, "name": "a", "is_wet": True},
        ),
        (
            {"colour": "grey", "size": ("weight", 9), "name": "Main & 1st", "wet": False},
            Painted(3, Chosen(1, b"\x09"), "Main & 1st", is_wet=False),
            {"colour": "unknown_3", "size": {"unknown_1": "09"}, "name": "Main & 1st"}
            | {"is_wet": False},
        ),
    ],
)
def test_enumerations_and_choices_of_a_later_edition_are_kept_and_printed(
    theirs: dict[str, bool | str | tuple[str, int]], ours: Painted, printed: Any
) -> None:
    data = OF_TOMORROW.encode("Painted", theirs)
    assert PAINTED.decode(data) == ours
    assert PAINTED.encode(ours) == data
    assert PAINTED.as_dict(ours) == printed


def test_a_choice_of_an_unknown_name_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"Painted.size: 'length' is not one of \['number'\]"):
        PAINTED.encode(Painted(Colour.RED, Chosen("length", 5), "a", is_wet=True))


def test_a_number_of_a_later_edition_is_above_those_of_this_one() -> None:
    with pytest.raises(ValueError, match=r"Painted.colour: -1 is below 0"):
        PAINTED.encode(Painted(1, Chosen("number", 5), "a", is_wet=True))


def test_a_number_of_any_size_is_a_normally_small_one() -> None:
    """X.691, 11.6: six bits up to 63, octets above."""
    ours = Painted(2 + 64, Chosen("number", 0), "a", is_wet=False)
    assert PAINTED.decode(PAINTED.encode(ours)) == ours
    assert PAINTED.encode(ours).startswith(bytes((0b1_1_000000, 0b01_010000)))


def test_a_number_of_more_than_eight_octets_is_too_long() -> None:
    ours = Painted(1 << 64, Chosen("number", 0), "a", is_wet=False)
    PAINTED.decode(PAINTED.encode(replace(ours, colour=(1 << 64) - 1)))
    with pytest.raises(DecodeError, match="9 octets") as refusal:
        PAINTED.decode(PAINTED.encode(replace(ours, colour=2 + (1 << 64))))
    assert refusal.value.reason == "too_long"
