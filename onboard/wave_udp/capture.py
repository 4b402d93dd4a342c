"""Captures: WSMs written as pcap that Wireshark dissects, and read from pcap or pcapng.

Formats: draft-ietf-opsawg-pcap and draft-ietf-opsawg-pcapng.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO, Final

from onboard.errors import UserError
from onboard.wave_udp.wlan_frame import content_of_frame, content_of_radiotap
from onboard.wave_udp.wsmp import ETHERTYPE, ETHERTYPE_GEONETWORKING, ethertype_of

LINKTYPE_ETHERNET: Final = 1
LINKTYPE_LINUX_SLL: Final = 113
LINKTYPE_LINUX_SLL2: Final = 276
LINKTYPE_IEEE802_11: Final = 105
LINKTYPE_IEEE802_11_RADIOTAP: Final = 127
LINKTYPES_IP: Final = (12, 14, 101, 228, 229)
"""LINKTYPE_RAW, which is 12 or 14 in files of some systems; IPv4; IPv6."""

_ETHERTYPE_IPV4 = 0x0800
_ETHERTYPE_IPV6 = 0x86DD
_ETHERTYPE_VLAN = 0x8100
_UDP = b"\x11"
_IPV6_HEADER_BYTES = 40
_SNAP_LENGTH = 65_535
OWN_MAC, OTHER_MAC = bytes.fromhex("020000000001"), bytes.fromhex("020000000002")
"""Used in captures, since radio units do not report the MAC of a sender (locally administered)."""
_BROADCAST = b"\xff" * 6


class CaptureError(UserError):
    """A file that is not a capture, or of an unsupported kind."""


@dataclass(frozen=True, slots=True)
class Packet:
    """One captured packet."""

    utc_s: float
    message: bytes | None
    """The WSM or GeoNetworking packet of a link-layer frame, or the content of a UDP datagram;
    `None` if it is none of them."""
    sender: bytes | None = None
    """MAC address of the sender of an Ethernet frame, 6 bytes."""


class PcapWriter:
    """Writes WSMs and GeoNetworking packets as Ethernet frames."""

    def __init__(self, file: BinaryIO) -> None:
        """Write the file header."""
        self._file = file
        file.write(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, _SNAP_LENGTH, LINKTYPE_ETHERNET))

    def write(self, wsm: bytes, utc_s: float, sender: bytes) -> None:
        """Append a frame.

        Args:
            wsm: the WSM or packet.
            utc_s: time of transmission.
            sender: MAC address, 6 bytes.
        """
        frame = _BROADCAST + sender + ethertype_of(wsm).to_bytes(2) + wsm
        seconds, microseconds = divmod(round(utc_s * 1e6), 1_000_000)
        self._file.write(struct.pack("<IIII", seconds, microseconds, len(frame), len(frame)))
        self._file.write(frame)


def is_capture(data: bytes) -> bool:
    """Return whether a file that begins with `data` is a pcap or pcapng."""
    return data[:4] in _PCAP or data[:4] == _PCAPNG


_PCAP = {
    bytes.fromhex("d4c3b2a1"): ("<", 1e-6),
    bytes.fromhex("a1b2c3d4"): (">", 1e-6),
    bytes.fromhex("4d3cb2a1"): ("<", 1e-9),
    bytes.fromhex("a1b23c4d"): (">", 1e-9),
}
"""Byte order and unit of the stamps, in seconds, by magic number."""

_PCAPNG = bytes.fromhex("0a0d0d0a")


def read_capture(data: bytes) -> Iterator[Packet]:
    """Yield every packet of a pcap or pcapng, in its order.

    Raises:
        CaptureError: it is neither, ends within a packet, or has an unsupported link type.
    """
    if not is_capture(data):
        raise CaptureError("neither pcap nor pcapng")
    try:
        yield from _read_pcap(data) if data[:4] in _PCAP else _read_pcapng(data)
    except struct.error as error:
        raise CaptureError("ends within a packet") from error


def _read_pcap(data: bytes) -> Iterator[Packet]:
    order, unit_s = _PCAP[data[:4]]
    (link_type,) = struct.unpack_from(order + "I", data, 20)
    position = 24
    while position < len(data):
        seconds, fraction, size, _ = struct.unpack_from(order + "IIII", data, position)
        frame, position = _cut(data, position + 16, size)
        yield _packet(seconds + fraction * unit_s, frame, link_type & 0xFFFF)


_SECTION_HEADER, _INTERFACE_DESCRIPTION, _ENHANCED_PACKET = 0x0A0D0D0A, 1, 6
_LITTLE_ENDIAN = bytes.fromhex("4d3c2b1a")
_SMALLEST_BLOCK = 12


def _read_pcapng(data: bytes) -> Iterator[Packet]:
    order = "<"
    interfaces: list[tuple[int, float]] = []
    position = 0
    while position < len(data):
        (block_type,) = struct.unpack_from(order + "I", data, position)
        if block_type == _SECTION_HEADER:
            order = "<" if data[position + 8 : position + 12] == _LITTLE_ENDIAN else ">"
            interfaces = []
        (size,) = struct.unpack_from(order + "I", data, position + 4)
        if size < _SMALLEST_BLOCK:
            raise CaptureError(f"a block of {size} bytes")
        block, position = _cut(data, position, size)
        if block_type == _INTERFACE_DESCRIPTION:
            interfaces.append(_interface(block, order))
        elif block_type == _ENHANCED_PACKET:
            yield _enhanced_packet(block, order, interfaces)


def _interface(block: bytes, order: str) -> tuple[int, float]:
    """Return link type and time unit in seconds (option if_tsresol, else microseconds)."""
    (link_type,) = struct.unpack_from(order + "H", block, 8)
    position = 16
    while position + 4 <= len(block) - 4:
        option, size = struct.unpack_from(order + "HH", block, position)
        if option == 9 and size == 1:  # if_tsresol
            (resolution,) = struct.unpack_from("B", block, position + 4)
            power = resolution & 0x7F
            return link_type, 2.0**-power if resolution & 0x80 else 10.0**-power
        position += 4 + (size + 3) // 4 * 4
    return link_type, 1e-6


def _enhanced_packet(block: bytes, order: str, interfaces: list[tuple[int, float]]) -> Packet:
    interface, high, low, size, _ = struct.unpack_from(order + "IIIII", block, 8)
    if interface >= len(interfaces):
        raise CaptureError(f"interface {interface} is not described")
    link_type, unit_s = interfaces[interface]
    frame, _ = _cut(block, 28, size)
    return _packet((high << 32 | low) * unit_s, frame, link_type)


def _cut(data: bytes, position: int, size: int) -> tuple[bytes, int]:
    end = position + size
    if end > len(data):
        raise struct.error
    return data[position:end], end


_ETHERTYPE_AT = {
    LINKTYPE_ETHERNET: (12, 14),
    LINKTYPE_LINUX_SLL: (14, 16),
    LINKTYPE_LINUX_SLL2: (0, 20),
}
"""Offsets of the EtherType and of the frame content, by link type."""


def _packet(utc_s: float, frame: bytes, link_type: int) -> Packet:
    sender = frame[6:12] if link_type == LINKTYPE_ETHERNET else None
    return Packet(utc_s, _message_in(frame, link_type), sender)


def _message_in(frame: bytes, link_type: int) -> bytes | None:
    try:
        found = _content_of(frame, link_type)
    except struct.error:  # captured only in part
        return None
    if found is None:
        return None
    ethertype, content = found
    if ethertype == _ETHERTYPE_VLAN:
        ethertype, content = int.from_bytes(content[2:4]), content[4:]
    if ethertype in {ETHERTYPE, ETHERTYPE_GEONETWORKING}:
        return content
    if ethertype == _ETHERTYPE_IPV4 and content[9:10] == _UDP:
        return _udp_content(content[(content[0] & 0x0F) * 4 :])
    if ethertype == _ETHERTYPE_IPV6 and content[6:7] == _UDP:
        return _udp_content(content[_IPV6_HEADER_BYTES:])
    return None


def _content_of(frame: bytes, link_type: int) -> tuple[int, bytes] | None:
    """Return EtherType and content of a link-layer frame; `None` if it has no content."""
    if link_type in _ETHERTYPE_AT:
        at, start = _ETHERTYPE_AT[link_type]
        return int.from_bytes(frame[at : at + 2]), frame[start:]
    if link_type in LINKTYPES_IP:
        return _ETHERTYPE_IPV6 if frame[:1] >= b"\x60" else _ETHERTYPE_IPV4, frame
    if link_type == LINKTYPE_IEEE802_11:
        return content_of_frame(frame)
    if link_type == LINKTYPE_IEEE802_11_RADIOTAP:
        return content_of_radiotap(frame)
    raise CaptureError(
        f"link type {link_type} is not read (Ethernet, Linux cooked, IP, 802.11 and radiotap are)"
    )


def _udp_content(datagram: bytes) -> bytes:
    return datagram[8 : int.from_bytes(datagram[4:6])]
