"""MAP and SPAT: bits and values as of another codec, extensions skipped, other bytes refused."""

import contextlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from hypothesis.strategies._internal.core import DataObject

from onboard.errors import DecodeError
from onboard.messages import map_data, spat
from onboard.messages.fields import Chosen
from onboard.messages.lane_nodes import node_offset
from onboard.messages.map_data import MAP_DATA, MapData
from onboard.messages.message_frame import FRAME, MessageFrame
from onboard.messages.record import Record
from onboard.messages.spat import (
    SPAT,
    Spat,
)
from tests.messages.crossing_messages import crossing_map, crossing_spat
from tests.messages.its_oracle import assert_same, decoded
from tests.messages.strategies import records

maps = records(MAP_DATA, most=2)
spats = records(SPAT, most=2)
slow = settings(
    max_examples=60,
    deadline=None,
    phases=[Phase.explicit, Phase.reuse, Phase.generate],  # shrinking takes minutes
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)


@pytest.mark.long
@slow
@given(maps)
def test_every_map_is_that_of_another_codec_and_is_read_again(message: MapData) -> None:
    _check(MAP_DATA, message)


@slow
@given(spats)
def test_every_spat_is_that_of_another_codec_and_is_read_again(message: Spat) -> None:
    _check(SPAT, message)


def _check(record: Record[Any], message: MapData | Spat) -> None:
    data = record.encode(message)
    assert_same(record, message, decoded(record, data))
    assert record.decode(data) == message


def test_a_crossing_has_its_values_by_the_other_codec() -> None:
    theirs = decoded(MAP_DATA, MAP_DATA.encode(crossing_map()))
    (intersection,) = theirs["intersections"]
    assert intersection["id"] == {"id": 501, "region": 7}
    assert intersection["refPoint"] == {
        "lat": 420_000_000,
        "long": -830_000_001,
        "elevation": 1800,
    }
    assert intersection["laneWidth"] == 350
    assert intersection["speedLimits"] == [{"type": "vehicleMaxSpeed", "speed": 695}]
    lane = intersection["laneSet"][0]
    assert lane["laneAttributes"]["directionalUse"] == (0b10, 2)
    assert lane["nodeList"][0] == "nodes"
    assert lane["connectsTo"][0]["signalGroup"] == 2
    (state,) = decoded(SPAT, SPAT.encode(crossing_spat()))["intersections"]
    assert state["moy"] == 240_000
    assert state["timeStamp"] == 12_300
    movement = state["states"][0]
    assert movement["signalGroup"] == 2
    assert movement["state-time-speed"] == [
        {
            "eventState": "protected-Movement-Allowed",
            "timing": {"minEndTime": 200, "maxEndTime": 250, "likelyTime": 220, "confidence": 13},
        }
    ]


@pytest.mark.parametrize(
    ("east_m", "north_m", "name"),
    [
        (5.11, -5.11, "node_xy1"),
        (-5.12, 0.0, "node_xy2"),
        (0.0, 10.24, "node_xy3"),
        (20.48, 0.0, "node_xy4"),
        (40.96, 0.0, "node_xy5"),
        (81.92, -327.67, "node_xy6"),
    ],
)
def test_a_node_takes_the_smallest_form(east_m: float, north_m: float, name: str) -> None:
    assert node_offset(east_m, north_m) == Chosen(name, (east_m, north_m))


def test_a_node_beyond_the_largest_form_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"\(400, 0\) m is too far"):
        node_offset(400.0, 0.0)


def test_additions_of_a_later_edition_are_skipped() -> None:
    """The frame, its message and an intersection each carry additions in their extensions."""
    message = crossing_spat()
    data = _bits(FRAME.encode(MessageFrame(19, b"")))[: 1 + 15]
    content = _bits(SPAT.encode(message), len_bits=None)
    extended = _with_additions(content[: _length(SPAT, message)])
    octets = _octets(extended)
    frame = _octets("1" + data[1:] + f"{len(octets):08b}" + _text(octets) + _ADDITIONS)
    assert spat.decode(frame) == message


_ADDITIONS = "0" + f"{2 - 1:06b}" + "10" + f"{3:08b}" + "1" * 24
"""Two are possible, one is there, as an open type of three octets (X.691, 19.7 to 19.9)."""


def _with_additions(bits: str) -> str:
    return "1" + bits[1:] + _ADDITIONS


def _length(record: Record[Any], message: MapData | Spat) -> int:
    from onboard.messages.bit_io import BitWriter

    writer = BitWriter()
    record.put(writer, message)
    return writer.bits


def _bits(data: bytes, len_bits: int | None = None) -> str:
    return _text(data)[:len_bits]


def _text(data: bytes) -> str:
    return "".join(f"{octet:08b}" for octet in data)


def _octets(bits: str) -> bytes:
    padded = bits + "0" * (-len(bits) % 8)
    return int(padded, 2).to_bytes(len(padded) // 8)


def test_each_kind_of_invalid_bytes_has_its_reason() -> None:
    good = spat.encode(crossing_spat())
    assert _reason(spat.decode, b"") == "too_short"
    assert _reason(spat.decode, good[:-1]) == "too_short"
    longer = good[:2] + bytes((good[2] + 1,)) + good[3:] + b"\x00"
    assert _reason(spat.decode, longer) == "trailing_bytes"
    assert _reason(spat.decode, map_data.encode(crossing_map())) == "not_a_spat"
    assert _reason(map_data.decode, good) == "not_a_map"


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"intersections": ()}, "intersections: 0 is not 1 to 32"),
        ({"msg_issue_revision": 128}, "msg_issue_revision: 128 is not 0 to 127"),
        ({"layer_id": 101}, "layer_id: 101 is not 0 to 100"),
    ],
)
def test_a_value_that_cannot_be_encoded_is_an_error_that_names_the_field(
    change: dict[str, int] | dict[str, tuple[()]], what: str
) -> None:
    with pytest.raises(ValueError, match=what):
        map_data.encode(replace(crossing_map(), **change))


def test_a_name_that_is_not_ascii_is_an_error() -> None:
    (state,) = crossing_spat().intersections
    with pytest.raises(ValueError, match="name: 'Hauptstraße' is not ASCII"):
        spat.encode(replace(crossing_spat(), intersections=(replace(state, name="Hauptstraße"),)))


@slow
@given(noise=st.binary(max_size=300), data=st.data())
def test_any_bytes_raise_only_decode_errors(noise: bytes, data: DataObject) -> None:
    for module, good in (
        (map_data, map_data.encode(crossing_map())),
        (spat, spat.encode(crossing_spat())),
    ):
        changed = bytearray(good)
        for _ in range(data.draw(st.integers(1, 4))):
            changed[data.draw(st.integers(0, len(changed) - 1))] = data.draw(st.integers(0, 255))
        for given_bytes in (noise, good[:2] + noise, bytes(changed)):
            with contextlib.suppress(DecodeError):
                module.as_dict(module.decode(given_bytes))


def _reason(decode: Callable[..., MapData] | Callable[..., Spat], data: bytes) -> str:
    with pytest.raises(DecodeError) as refused:
        decode(data)
    return refused.value.reason
