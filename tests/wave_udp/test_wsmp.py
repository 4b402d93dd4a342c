"""The WSMP frame, byte by byte (IEEE 1609.3-2020, 8.3; version 2: IEEE 1609.3-2010)."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.wave_udp.psid import HIGHEST
from onboard.wave_udp.wsmp import (
    MAX_DATA_BYTES,
    Element,
    WaveShortMessage,
    decode,
    encode,
    ethertype_of,
)

PLAIN = WaveShortMessage(psid=0x20, payload=b"\x03\x80\x01\xaa")
TUNED = WaveShortMessage(
    psid=0x4020,
    payload=b"\xaa",
    channel_number=172,
    data_rate_mbit_s=6.0,
    transmit_power_dbm=20,
)
STRANGE = WaveShortMessage(
    psid=0x20,
    payload=b"\xaa",
    channel_number=183,
    n_extensions=(Element(25, b"\x07"), Element(99, b"")),
    t_extensions=(Element(80, b"\x01\x02"),),
)
VECTORS = [
    pytest.param(PLAIN, "03 00 20 04 038001aa", id="plain"),
    pytest.param(TUNED, "0b 03 0f01ac 10010c 040194 00 bfa0 01 aa", id="tuned"),
    pytest.param(STRANGE, "0b 03 0f01b7 190107 6300 01 20 01 50020102 01 aa", id="strange"),
    pytest.param(WaveShortMessage(0x20, b""), "03 00 20 00", id="no data"),
]


@pytest.mark.parametrize(("wsm", "octets"), VECTORS)
def test_byte_vectors(wsm: WaveShortMessage, octets: str) -> None:
    assert encode(wsm) == bytes.fromhex(octets)
    assert decode(bytes.fromhex(octets)) == wsm


@pytest.mark.parametrize(("wsm", "octets"), VECTORS)
def test_a_frame_that_ends_early_is_too_short_wherever_it_ends(
    wsm: WaveShortMessage, octets: str
) -> None:
    whole = bytes.fromhex(octets)
    for size in range(len(whole)):
        with pytest.raises(DecodeError) as refused:
            decode(whole[:size])
        assert refused.value.reason == "too_short"


@pytest.mark.parametrize(
    ("size", "length"),
    [
        (0, "00"),
        (127, "7f"),
        (128, "8080"),
        (255, "80ff"),
        (256, "8100"),
        (1400, "8578"),
        (MAX_DATA_BYTES, "bfff"),
    ],
)
def test_the_wsm_length_takes_two_octets_from_128(size: int, length: str) -> None:
    wsm = WaveShortMessage(0x20, bytes(size))
    assert encode(wsm) == bytes.fromhex("030020" + length) + bytes(size)
    assert decode(encode(wsm)) == wsm


def test_padding_of_the_link_layer_is_not_part_of_the_message() -> None:
    assert decode(encode(PLAIN) + bytes(38)) == PLAIN


def test_a_small_length_in_two_octets_is_accepted() -> None:
    assert decode(bytes.fromhex("030020 8001 aa")) == WaveShortMessage(0x20, b"\xaa")


def test_an_element_of_unexpected_size_or_number_is_kept_unchanged() -> None:
    frame = bytes.fromhex("0b 03 0f02acac 0f01ac 0f01b7 00 20 01 aa")
    wsm = decode(frame)
    assert wsm.channel_number == 172
    assert wsm.n_extensions == (Element(15, b"\xac\xac"), Element(15, b"\xb7"))
    assert decode(encode(wsm)) == wsm


@pytest.mark.parametrize(
    ("octets", "reason"),
    [
        ("", "too_short"),
        ("00 00 20 00", "unknown_version"),
        ("01 00 20 00", "unknown_version"),
        ("04 00 20 00", "unknown_version"),
        ("0a 20 80 0000", "unknown_version"),
        ("13 00 20 00", "unknown_subtype"),
        ("f3 00 20 00", "unknown_subtype"),
        ("03 02 0001 0002 00", "unknown_tpid"),
        ("03 80 04 00140100", "unknown_tpid"),
        ("03 00 f0 00", "bad_psid"),
        ("03 00 20 c0 00", "bad_length"),
        ("0b c0", "bad_length"),
        ("0b bf ff 0f", "too_short"),
    ],
)
def test_invalid_wsms_are_refused(octets: str, reason: str) -> None:
    with pytest.raises(DecodeError) as refused:
        decode(bytes.fromhex(octets))
    assert refused.value.reason == reason


# Version 2: channel 172, 3 Mbit/s, 14 dBm in two's complement; WSMP, WSMP-S, WSMP-I.
V2_HEAD = "02 20 0f01ac 100106 04010e"


def test_version_2_is_read() -> None:
    wsm = decode(bytes.fromhex(V2_HEAD + "80 0002 aabb"))
    assert wsm == WaveShortMessage(0x20, b"\xaa\xbb", 172, 3.0, 14, version=2)


def test_version_2_counts_power_in_twos_complement_and_version_3_from_minus_128() -> None:
    assert decode(bytes.fromhex("02 20 0401f6 80 0000")).transmit_power_dbm == -10
    assert decode(bytes.fromhex("0b 01 040176 00 20 00")).transmit_power_dbm == -10


def test_version_2_with_a_safety_supplement_or_identity() -> None:
    assert decode(bytes.fromhex("02 20 81 0004 8101 aabb")).payload == b"\xaa\xbb"
    assert decode(bytes.fromhex("02 20 82 0002 aabb")).payload == b"\xaa\xbb"


def test_an_unknown_element_of_version_2_is_kept() -> None:
    assert decode(bytes.fromhex("02 20 7702beef 80 0000")).n_extensions == (
        Element(0x77, b"\xbe\xef"),
    )


@pytest.mark.parametrize("tail", ["80 0002 aabb", "81 0004 8101 aabb", "82 0002 aabb"])
def test_version_2_that_ends_early_is_too_short_wherever_it_ends(tail: str) -> None:
    whole = bytes.fromhex(V2_HEAD + tail)
    for size in range(len(whole)):
        with pytest.raises(DecodeError) as refused:
            decode(whole[:size])
        assert refused.value.reason == "too_short"


def test_a_supplement_without_end_is_too_short() -> None:
    with pytest.raises(DecodeError, match="too_short"):
        decode(bytes.fromhex("02 20 81 0002 8181"))


octet = st.integers(0, 255)
elements = st.lists(
    st.builds(Element, octet.filter(lambda i: i not in {4, 15, 16}), st.binary(max_size=200)),
    max_size=4,
).map(tuple)
wsms = st.builds(
    WaveShortMessage,
    psid=st.integers(0, HIGHEST),
    payload=st.binary(max_size=300)
    | st.sampled_from([127, 128, 255, 256, 1400, MAX_DATA_BYTES]).map(bytes),
    channel_number=st.none() | octet,
    data_rate_mbit_s=st.none() | octet.map(lambda n: n / 2),
    transmit_power_dbm=st.none() | st.integers(-128, 127),
    n_extensions=elements,
    t_extensions=elements,
)


@given(wsms)
def test_encoding_and_decoding_give_the_same_message(wsm: WaveShortMessage) -> None:
    assert decode(encode(wsm)) == wsm


@given(st.binary(max_size=64))
def test_any_bytes_decode_or_are_refused(data: bytes) -> None:
    try:
        wsm = decode(data)
    except DecodeError:
        return
    if wsm.version == 3:
        assert decode(encode(wsm)) == wsm


@pytest.mark.parametrize(
    ("wsm", "message"),
    [
        (WaveShortMessage(-1, b""), "a PSID is"),
        (WaveShortMessage(0x20, bytes(MAX_DATA_BYTES + 1)), "length is 16383 at most"),
        (WaveShortMessage(0x20, b"", channel_number=256), "element 15 is one octet"),
        (WaveShortMessage(0x20, b"", data_rate_mbit_s=128.0), "element 16 is one octet"),
        (WaveShortMessage(0x20, b"", data_rate_mbit_s=6.25), "multiple of 0.5"),
        (WaveShortMessage(0x20, b"", transmit_power_dbm=128), "element 4 is one octet"),
        (WaveShortMessage(0x20, b"", version=2), "version 2 is only read"),
    ],
)
def test_a_wsm_that_cannot_be_encoded_is_a_value_error(wsm: WaveShortMessage, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        encode(wsm)


@pytest.mark.realdata
def test_eighteen_wsms_of_real_units_are_decoded_and_encoded_again(rig_data: Path) -> None:
    lines = (rig_data / "wsm" / "real-wsms.jsonl").read_text().splitlines()
    assert len(lines) == 18
    for line in lines:
        record = json.loads(line)
        frame = bytes.fromhex(record["wsm"])
        wsm = decode(frame)
        header = record["wsmp"]
        assert (wsm.version, wsm.psid) == (header["version"], header["psid"])
        assert len(wsm.payload) == header["length"]
        assert frame[1] == header["tpid"]
        assert encode(wsm) == frame


def test_a_frame_has_the_ethertype_of_its_protocol() -> None:
    geonetworking = ("11001a01", "12001a01", "01001a01", "02001a01", "00001a01")
    wsms = ("0300bfa0", "0b010f01", "022001", "0220")
    assert [ethertype_of(bytes.fromhex(each)) for each in geonetworking] == [0x8947] * 5
    assert [ethertype_of(bytes.fromhex(each)) for each in wsms] == [0x88DC] * 4
