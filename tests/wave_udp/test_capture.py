"""Captures of WSMs: written ones are decoded by tshark, and those of others are read."""

import json
import shutil
import socket
import struct
import subprocess
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.wave_udp import capture
from onboard.wave_udp.capture import CaptureError, Packet, PcapWriter, is_capture, read_capture
from onboard.wave_udp.wsmp import Element, WaveShortMessage, encode
from tests.typed import a

LUA = Path(capture.__file__).with_name("wsm_udp.lua")
SENDER = bytes.fromhex("02c0ffee0001")
UTC_S = 1_700_000_000.25

UNSECURED = bytes.fromhex("0380 04 00140100")
WSMS = [
    WaveShortMessage(0x20, UNSECURED),
    WaveShortMessage(0x4020, UNSECURED),
    WaveShortMessage(
        0x4020,
        bytes(1400),
        channel_number=172,
        data_rate_mbit_s=6.0,
        transmit_power_dbm=-10,
        n_extensions=(Element(99, b"abc"),),
    ),
    *(WaveShortMessage(psid, b"", 183) for psid in (0, 0x7F, 0x80, 0x407F, 0x4080, 0x1020407F)),
    *(WaveShortMessage(0x4021, bytes(size)) for size in (127, 128, 255, 256, 16_383)),
]

needs_tshark = pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")


def write_pcap(path: Path, frames: Iterable[bytes]) -> Path:
    with path.open("wb") as file:
        writer = PcapWriter(file)
        for number, frame in enumerate(frames):
            writer.write(frame, UTC_S + number, SENDER)
    return path


def tshark(path: Path, *options: str) -> list[dict[str, list[Any]]]:
    """Return the fields that tshark decodes of each packet, as `{field: [value, ...]}`."""
    command = ["tshark", "-n", "-r", str(path), "-T", "json", "--no-duplicate-keys", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    return [gather(packet["_source"]["layers"], {}) for packet in json.loads(done.stdout)]


def gather(tree: Any, found: Any) -> Any:
    if isinstance(tree, dict):
        for key, value in tree.items():
            found.setdefault(key, []).extend(value if isinstance(value, list) else [value])
            gather(value, found)
    elif isinstance(tree, list):
        for item in tree:
            gather(item, found)
    return found


def expected_fields(wsm: WaveShortMessage) -> dict[str, list[str]]:
    elements = [
        (15, wsm.channel_number),
        (16, None if wsm.data_rate_mbit_s is None else int(wsm.data_rate_mbit_s * 2)),
        (4, None if wsm.transmit_power_dbm is None else wsm.transmit_power_dbm + 128),
    ]
    octets = [(i, f"{octet:02x}") for i, octet in elements if octet is not None]
    octets += [(e.element_id, e.content.hex(":")) for e in wsm.n_extensions]
    return {
        "wsmp.version_v3": ["3"],
        "wsmp.subtype": ["0"],
        "wsmp.psid": [f"0x{wsm.psid:08x}"],
        "wsmp.wave_ie": [str(i) for i, _ in octets] + ["0"],  # the last is the TPID
        "wsmp.wave_ie_data": [content for _, content in octets],
        "wsmp.wave_ie_len": [str(len(content.split(":"))) for _, content in octets]
        + [str(len(wsm.payload))],
    }


def assert_as_meant(fields: Any, wsm: WaveShortMessage) -> None:
    for name, values in expected_fields(wsm).items():
        assert fields.get(name, []) == values, (name, wsm)
    assert "_ws.malformed" not in fields, wsm
    assert "wsmp.length_field_err" not in fields
    assert "_ws.lua.error" not in fields


@needs_tshark
def test_tshark_decodes_each_field_of_a_wsm_and_finds_nothing_malformed(tmp_path: Path) -> None:
    path = write_pcap(tmp_path / "ours.pcap", map(encode, WSMS))
    packets = tshark(path)
    assert len(packets) == len(WSMS)
    for number, (fields, wsm) in enumerate(zip(packets, WSMS, strict=True)):
        assert_as_meant(fields, wsm)
        assert fields["eth.src"] == [SENDER.hex(":")]
        assert float(fields["frame.time_epoch"][0]) == UTC_S + number
    assert packets[0]["ieee1609dot2.unsecuredData"] == ["00:14:01:00"]


@needs_tshark
def test_with_the_lua_file_tshark_decodes_wsms_inside_udp(tmp_path: Path) -> None:
    path = tmp_path / "udp.pcap"
    wsms = [wsm for wsm in WSMS if len(wsm.payload) < 1500]
    path.write_bytes(pcap_of([ethernet_udp(encode(wsm)) for wsm in wsms]))
    packets = tshark(path, "-X", f"lua_script:{LUA}")
    for fields, wsm in zip(packets, wsms, strict=True):
        assert_as_meant(fields, wsm)


@needs_tshark
def test_the_lua_file_leaves_other_datagrams_alone(tmp_path: Path) -> None:
    others = ["", "03", "0bbfff0f01", "0300ff00", "030020c000", "0300200561", "0b010f", "03002080"]
    datagrams = [bytes.fromhex(digits) for digits in others] + [b"Version=0.7\n", bytes(1000)]
    path = tmp_path / "udp.pcap"
    path.write_bytes(pcap_of(map(ethernet_udp, datagrams)))
    for fields in tshark(path, "-X", f"lua_script:{LUA}"):
        assert not {"wsmp", "_ws.lua.error", "_ws.malformed"} & set(fields)


@needs_tshark
@pytest.mark.realdata
def test_wsms_of_real_units_encoded_again_are_well_formed(rig_data: Path, tmp_path: Path) -> None:
    lines = (rig_data / "wsm" / "real-wsms.jsonl").read_text().splitlines()
    frames = [bytes.fromhex(json.loads(line)["wsm"]) for line in lines]
    packets = tshark(write_pcap(tmp_path / "real.pcap", frames))
    assert len(packets) == 18
    for fields in packets:
        assert "_ws.malformed" not in fields
        assert "ieee1609dot2.signedData_element" in fields


def ethernet(ethertype: int, content: bytes) -> bytes:
    return b"\xff" * 6 + SENDER + ethertype.to_bytes(2) + content


def ipv4_udp(content: bytes, protocol: int = 17) -> bytes:
    udp = struct.pack(">HHHH", 40_000, 40_001, 8 + len(content), 0) + content
    local = socket.inet_aton("127.0.0.1")
    head = struct.pack(
        ">BBHHHBBH4s4s", 0x45, 0xE0, 20 + len(udp), 0, 0, 64, protocol, 0, local, local
    )
    return head + udp


def ipv6_udp(content: bytes) -> bytes:
    udp = struct.pack(">HHHH", 40_000, 40_001, 8 + len(content), 0) + content
    return struct.pack(">IHBB32s", 6 << 28, len(udp), 17, 64, bytes(32)) + udp


def ethernet_udp(content: bytes) -> bytes:
    return ethernet(0x0800, ipv4_udp(content))


def pcap_of(
    frames: Iterable[bytes],
    link_type: int = 1,
    order: str = "<",
    magic: int = 0xA1B2C3D4,
    fraction: int = 250_000,
) -> bytes:
    data = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 65_535, link_type)
    for frame in frames:
        data += struct.pack(order + "IIII", int(UTC_S), fraction, len(frame), len(frame)) + frame
    return data


def messages(data: bytes) -> list[bytes | None]:
    return [packet.message for packet in read_capture(data)]


WSM = encode(WSMS[0])


@given(st.lists(st.tuples(st.binary(max_size=300), st.integers(0, 2**32 - 1)), max_size=5))
def test_a_written_capture_is_read_back(written: list[tuple[bytes, int]]) -> None:
    file = BytesIO()
    writer = PcapWriter(file)
    for wsm, seconds in written:
        writer.write(wsm, seconds + 0.5, SENDER)
    assert list(read_capture(file.getvalue())) == [
        Packet(seconds + 0.5, wsm, SENDER) for wsm, seconds in written
    ]


def test_both_byte_orders_and_both_clocks_of_pcap() -> None:
    for order in "<>":
        for magic, fraction in ((0xA1B2C3D4, 250_000), (0xA1B23C4D, 250_000_000)):
            data = pcap_of([ethernet(0x88DC, WSM)], 1, order, magic, fraction)
            assert list(read_capture(data)) == [Packet(UTC_S, WSM, SENDER)]


@pytest.mark.parametrize(
    ("link_type", "frame", "message"),
    [
        pytest.param(1, ethernet(0x88DC, WSM), WSM, id="WSMP"),
        pytest.param(1, ethernet(0x8100, b"\0\1\x88\xdc" + WSM), WSM, id="WSMP in a VLAN"),
        pytest.param(1, ethernet(0x0800, ipv4_udp(WSM) + b"\0" * 9), WSM, id="UDP, padded"),
        pytest.param(1, ethernet(0x86DD, ipv6_udp(WSM)), WSM, id="UDP over IPv6"),
        pytest.param(113, bytes(14) + b"\x88\xdc" + WSM, WSM, id="Linux cooked"),
        pytest.param(276, b"\x88\xdc" + bytes(18) + WSM, WSM, id="Linux cooked 2"),
        pytest.param(1, ethernet(0x0800, ipv4_udp(WSM, protocol=6)), None, id="TCP"),
        pytest.param(1, ethernet(0x0806, bytes(28)), None, id="ARP"),
        pytest.param(1, b"", None, id="nothing"),
        pytest.param(1, ethernet(0x0800, b""), None, id="IP without its header"),
    ],
)
def test_a_message_is_found_in_each_kind_of_frame(
    link_type: int, frame: bytes, message: bytes | None
) -> None:
    assert messages(pcap_of([frame], link_type)) == [message]


ADDRESSES = b"\xff" * 6 + SENDER + b"\xff" * 6
"""To everybody, outside the context of a BSS."""
SNAP = bytes.fromhex("aaaa03000000")


def wlan(content: bytes, control: str = "0800", more: bytes = b"") -> bytes:
    return bytes.fromhex(control) + bytes(2) + ADDRESSES + bytes(2) + more + content


def radiotap(frame: bytes, fields: bytes = b"", present: int = 0) -> bytes:
    return struct.pack("<BBHI", 0, 0, 8 + len(fields), present) + fields + frame


WAVE = b"\x88\xdc" + WSM
WLAN_FRAMES = {
    "LLC and SNAP": (105, wlan(SNAP + WAVE)),
    "QoS": (105, wlan(SNAP + WAVE, "8800", bytes(2))),
    "QoS and HT control": (105, wlan(SNAP + WAVE, "8880", bytes(6))),
    "four addresses": (105, wlan(SNAP + WAVE, "0803", SENDER)),
    "radiotap": (127, radiotap(wlan(SNAP + WAVE))),
    "radiotap with time, flags and FCS": (
        127,
        radiotap(wlan(SNAP + WAVE) + bytes(4), bytes(8) + b"\x10", 0b11),
    ),
    "radiotap with padding": (
        127,
        radiotap(wlan(SNAP + WAVE, "8800", bytes(4)), b"\x20", 0b10),
    ),
    "radiotap with two words of presence": (
        127,
        radiotap(wlan(SNAP + WAVE), bytes(4) + bytes(8) + b"\0", 1 << 31 | 0b11),
    ),
}


@pytest.mark.parametrize(("link_type", "frame"), WLAN_FRAMES.values(), ids=WLAN_FRAMES)
def test_a_wsm_is_found_in_each_kind_of_802_11_frame(link_type: int, frame: bytes) -> None:
    (message,) = messages(pcap_of([frame], link_type))
    assert message is not None
    assert message.removesuffix(bytes(4)) == WSM


@pytest.mark.long
@needs_tshark
@pytest.mark.parametrize(("link_type", "frame"), WLAN_FRAMES.values(), ids=WLAN_FRAMES)
def test_tshark_finds_the_wsm_in_the_same_802_11_frame(
    tmp_path: Path, link_type: int, frame: bytes
) -> None:
    path = tmp_path / "wlan.pcap"
    path.write_bytes(pcap_of([frame], link_type))
    (fields,) = tshark(path)
    assert fields["wsmp.psid"] == ["0x00000020"]


def test_without_llc_an_ethertype_begins_the_content() -> None:
    """EtherType protocol discrimination (IEEE 802-2014, 9.2)."""
    assert messages(pcap_of([wlan(WAVE)], 105)) == [WSM]


@pytest.mark.parametrize(
    ("link_type", "frame"),
    [
        (105, wlan(b"", "8000")),
        (105, wlan(b"", "4800")),
        (105, wlan(SNAP + WAVE, "0840")),
        (105, wlan(SNAP + WAVE)[:20]),
        (127, radiotap(b"")),
        (127, b"\0\0"),
        (127, radiotap(b"")[:2] + b"\xff\xff" + b"\xff" * 4),
        (101, b""),
        (101, ipv4_udp(b"abc", protocol=6)),
    ],
    ids=["beacon", "no data", "encrypted", "cut", "empty", "cut radiotap", "long radiotap", "none",
         "TCP"],
)  # fmt: skip
def test_other_frames_have_no_message(link_type: int, frame: bytes) -> None:
    assert messages(pcap_of([frame], link_type)) == [None]


@pytest.mark.parametrize("link_type", [12, 14, 101, 228, 229])
def test_udp_is_found_in_packets_without_link_layer(link_type: int) -> None:
    packet = ipv6_udp(b"abc") if link_type == 229 else ipv4_udp(b"abc")
    assert messages(pcap_of([packet], link_type)) == [b"abc"]
    assert messages(pcap_of([ipv6_udp(b"abc")], 101)) == [b"abc"]


@needs_tshark
def test_pcapng_as_wireshark_writes_it(tmp_path: Path) -> None:
    ours = write_pcap(tmp_path / "ours.pcap", [WSM, encode(WSMS[2])])
    theirs = tmp_path / "theirs.pcapng"
    subprocess.run(["tshark", "-r", ours, "-F", "pcapng", "-w", theirs], check=True,
                   capture_output=True)  # fmt: skip
    assert is_capture(theirs.read_bytes())
    assert list(read_capture(theirs.read_bytes())) == list(read_capture(ours.read_bytes()))


def block(block_type: int, body: bytes, order: str) -> bytes:
    size = len(body) + 12
    return struct.pack(order + "II", block_type, size) + body + struct.pack(order + "I", size)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(("resolution", "unit_s"), [(None, 1e-6), (9, 1e-9), (0x80 | 10, 2**-10)])
def test_pcapng_with_any_byte_order_and_clock(
    order: str, resolution: int | None, unit_s: float
) -> None:
    frame = ethernet(0x88DC, WSM)
    frame += bytes(-len(frame) % 4)
    ticks = round(UTC_S / unit_s)
    options = b"" if resolution is None else (
        struct.pack(order + "HH4s", 2, 4, b"eth0")
        + struct.pack(order + "HHB3x", 9, 1, resolution)
        + struct.pack(order + "HH", 0, 0)
    )  # fmt: skip
    data = (
        block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1), order)
        + block(1, struct.pack(order + "HHI", 1, 0, 65_535) + options, order)
        + block(5, bytes(12), order)  # interface statistics
        + block(6, struct.pack(order + "IIIII", 0, ticks >> 32, ticks & 0xFFFFFFFF,
                               len(frame), len(frame)) + frame, order)
    )  # fmt: skip
    (packet,) = read_capture(data)
    assert packet.utc_s == pytest.approx(UTC_S)
    assert a(bytes, packet.message).startswith(WSM)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"not a capture", "neither pcap nor pcapng"),
        (pcap_of([WSM], link_type=147), "link type 147 is not read"),
        (pcap_of([ethernet(0x88DC, WSM)])[:-1], "ends within a packet"),
        (pcap_of([])[:10], "ends within a packet"),
        (block(0x0A0D0D0A, b"\x4d\x3c\x2b\x1a" + bytes(12), "<")
         + block(6, bytes(20), "<"), "interface 0 is not described"),
        (struct.pack("<II", 0x0A0D0D0A, 0) + b"\x4d\x3c\x2b\x1a", "a block of 0 bytes"),
    ],
)  # fmt: skip
def test_an_invalid_capture_is_an_error_that_names_the_fault(data: bytes, message: str) -> None:
    with pytest.raises(CaptureError, match=message):
        messages(data)
