"""WAVE short message protocol (IEEE 1609.3-2020, 8.3): the frame around every message on the air.

Version 3, octet by octet:

    N-header    subtype (4 bits), option indicator (1), version (3)
                [count, then so many information elements: id, length, content]
                TPID: 0, or 1 where the T-header has information elements too
    T-header    PSID, p-encoded
                [information elements as above]
                WSM length
    WSM data

Counts and lengths take one octet up to 127 and two above (8.1.3). Channel, data rate and power of
the N-header are fields here; other elements are kept as bytes. Version 2 (IEEE 1609.3-2010) is read
and never written.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from onboard.errors import DecodeError
from onboard.wave_udp.psid import p_decode, p_encode

ETHERTYPE: Final = 0x88DC
"""EtherType of WSMP on the link layer (IEEE 1609.3-2020, 5.2.1)."""

ETHERTYPE_GEONETWORKING: Final = 0x8947
"""EtherType of what ITS-G5 has in place of WSMP (ETSI EN 302 636-4-2)."""

VERSION: Final = 3
VERSIONS_READ: Final = (2, VERSION)
MAX_DATA_BYTES: Final = 0x3FFF
"""Greatest WSM length; radios carry 1,400 bytes by default."""

READ_AGAIN: Final = 256
"""Number of the last frames whose reading is kept: the receive queue reads each, then the cores."""

_TRANSMIT_POWER_USED = 4
_CHANNEL_NUMBER = 15
_DATA_RATE = 16
_FIELDS = (_CHANNEL_NUMBER, _DATA_RATE, _TRANSMIT_POWER_USED)
_OPTION_INDICATOR = 0x08
_WSM_ELEMENTS = (0x80, 0x81, 0x82)
"""Version 2: WSMP, WSMP-S, WSMP-I. The first of them ends the header."""
_WSMP_S = 0x81


def ethertype_of(frame: bytes) -> int:
    """Return the EtherType of a frame.

    GeoNetworking begins with four bits of its version, which is 0 or 1, four of the next header,
    which is 0 to 2, and an octet of zeros. The octet 2 also begins a WSM of version 2, in which the
    next one is of its PSID, and 0 is that of no message.
    """
    is_version_0 = frame[:1] in {b"\x00", b"\x01"} or frame[:2] == b"\x02\x00"
    is_geonetworking = is_version_0 or frame[:1] >= b"\x10"
    return ETHERTYPE_GEONETWORKING if is_geonetworking else ETHERTYPE


@dataclass(frozen=True, slots=True)
class Element:
    """A WAVE information element that is not interpreted."""

    element_id: int
    content: bytes


@dataclass(frozen=True, slots=True)
class WaveShortMessage:
    """One WSM. `None` stands for fields that the sender left out."""

    psid: int
    payload: bytes
    """The WSM data; `onboard` sends 1609.2 data."""
    channel_number: int | None = None
    """IEEE 802.11 channel that it was sent on, 0 to 255; 172 is 5.860 GHz."""
    data_rate_mbit_s: float | None = None
    """0 to 127.5 by 0.5."""
    transmit_power_dbm: int | None = None
    """Transmit power used, -128 to 127."""
    n_extensions: tuple[Element, ...] = ()
    """Other elements of the N-header."""
    t_extensions: tuple[Element, ...] = ()
    """Elements of the T-header."""
    version: int = VERSION


def encode(wsm: WaveShortMessage) -> bytes:
    """Return the frame as it is sent, in version 3.

    Raises:
        ValueError: a field cannot carry its value.
    """
    if wsm.version != VERSION:
        raise ValueError(f"WSMP version {wsm.version} is only read")
    n_extensions = _fields(wsm) + wsm.n_extensions
    return b"".join(
        (
            bytes((VERSION | _OPTION_INDICATOR,)) if n_extensions else bytes((VERSION,)),
            _extensions(n_extensions),
            b"\1" if wsm.t_extensions else b"\0",
            p_encode(wsm.psid),
            _extensions(wsm.t_extensions),
            _length(len(wsm.payload)),
            wsm.payload,
        )
    )


@lru_cache(READ_AGAIN)
def decode(data: bytes) -> WaveShortMessage:
    """Read a frame. Bytes after the WSM data are padding of the link layer and ignored.

    Raises:
        DecodeError: `too_short`, `unknown_version`, `unknown_subtype`, `unknown_tpid`, `bad_length`
            or `bad_psid`.
    """
    if not data:
        raise DecodeError("too_short", "no byte")
    version = data[0] & 0x07
    if version == VERSION:
        return _decode_version_3(data)
    if data[0] == 2:
        return _decode_version_2(data)
    raise DecodeError("unknown_version", f"{version} instead of {VERSION} or 2")


def _decode_version_3(data: bytes) -> WaveShortMessage:
    if data[0] >> 4:
        raise DecodeError("unknown_subtype", f"{data[0] >> 4} instead of 0 (null-networking)")
    position = 1
    n_extensions: tuple[Element, ...] = ()
    if data[0] & _OPTION_INDICATOR:
        n_extensions, position = _read_extensions(data, position)
    (tpid,), position = _take(data, position, 1)
    if tpid > 1:
        raise DecodeError("unknown_tpid", f"{tpid} instead of 0 or 1 (PSID as address)")
    psid, position = p_decode(data, position)
    t_extensions: tuple[Element, ...] = ()
    if tpid:
        t_extensions, position = _read_extensions(data, position)
    size, position = _read_length(data, position)
    payload, _ = _take(data, position, size)
    return _message(psid, payload, n_extensions, t_extensions, VERSION)


def _decode_version_2(data: bytes) -> WaveShortMessage:
    """1609.3-2010, 8.3: PSID, elements with one length octet, WSM element id, two octets length."""
    psid, position = p_decode(data, 1)
    elements = []
    while True:
        (element_id,), position = _take(data, position, 1)
        if element_id in _WSM_ELEMENTS:
            break
        (size,), position = _take(data, position, 1)
        content, position = _take(data, position, size)
        elements.append(Element(element_id, content))
    size_octets, position = _take(data, position, 2)
    payload, _ = _take(data, position, int.from_bytes(size_octets))
    if element_id == _WSMP_S:
        payload = _without_supplement(payload)
    return _message(psid, payload, tuple(elements), (), version=2)


def _without_supplement(payload: bytes) -> bytes:
    """Remove the safety supplement: octets up to the first one below 0x80."""
    for position, octet in enumerate(payload, start=1):
        if octet < 0x80:
            return payload[position:]
    raise DecodeError("too_short", "ends within the safety supplement")


def _message(
    psid: int,
    payload: bytes,
    n_extensions: tuple[Element, ...],
    t_extensions: tuple[Element, ...],
    version: int,
) -> WaveShortMessage:
    """Make the message, with channel, data rate and power taken from the N-header elements.

    Args:
        psid: of the T-header.
        payload: the WSM data.
        n_extensions: all elements of the N-header.
        t_extensions: all elements of the T-header.
        version: 2 or 3.
    """
    octets: dict[int, int] = {}
    others = []
    for element in n_extensions:
        known = element.element_id in _FIELDS and element.element_id not in octets
        if known and len(element.content) == 1:
            octets[element.element_id] = element.content[0]
        else:
            others.append(element)
    data_rate = octets.get(_DATA_RATE)
    power = octets.get(_TRANSMIT_POWER_USED)
    return WaveShortMessage(
        psid=psid,
        payload=payload,
        channel_number=octets.get(_CHANNEL_NUMBER),
        data_rate_mbit_s=None if data_rate is None else data_rate / 2,
        transmit_power_dbm=None if power is None else _power_dbm(power, version),
        n_extensions=tuple(others),
        t_extensions=t_extensions,
        version=version,
    )


def _power_dbm(octet: int, version: int) -> int:
    """Version 3 has INTEGER (-128..127) in PER, an offset from -128; version 2 two's complement."""
    return octet - 128 if version == VERSION else (octet ^ 0x80) - 128


def _fields(wsm: WaveShortMessage) -> tuple[Element, ...]:
    channel, data_rate, power = wsm.channel_number, wsm.data_rate_mbit_s, wsm.transmit_power_dbm
    steps = None if data_rate is None else round(data_rate * 2)
    if data_rate is not None and steps != data_rate * 2:
        raise ValueError(f"a data rate is a multiple of 0.5 Mbit/s (given {data_rate})")
    octets = (channel, steps, None if power is None else power + 128)
    for element_id, octet in zip(_FIELDS, octets, strict=True):
        if octet is not None and not 0 <= octet <= 0xFF:
            raise ValueError(f"WSMP element {element_id} is one octet (given {octet})")
    return tuple(
        Element(element_id, bytes((octet,)))
        for element_id, octet in zip(_FIELDS, octets, strict=True)
        if octet is not None
    )


def _extensions(elements: tuple[Element, ...]) -> bytes:
    if not elements:
        return b""
    parts = [_length(len(elements))]
    for element in elements:
        parts += (bytes((element.element_id,)), _length(len(element.content)), element.content)
    return b"".join(parts)


def _read_extensions(data: bytes, position: int) -> tuple[tuple[Element, ...], int]:
    count, position = _read_length(data, position)
    elements = []
    for _ in range(count):
        (element_id,), position = _take(data, position, 1)
        size, position = _read_length(data, position)
        content, position = _take(data, position, size)
        elements.append(Element(element_id, content))
    return tuple(elements), position


def _length(size: int) -> bytes:
    """Encode a length (8.1.3): 0 and seven bits, or 10 and fourteen."""
    if size > MAX_DATA_BYTES:
        raise ValueError(f"a WSMP length is {MAX_DATA_BYTES} at most (given {size})")
    return bytes((size,)) if size < 0x80 else (0x8000 | size).to_bytes(2)


def _read_length(data: bytes, position: int) -> tuple[int, int]:
    """Read a length. Two octets for a small number are accepted: some senders write them."""
    (first,), position = _take(data, position, 1)
    if first < 0x80:
        return first, position
    if first >= 0xC0:
        raise DecodeError("bad_length", f"first octet {first:#04x}")
    (second,), position = _take(data, position, 1)
    return (first & 0x3F) << 8 | second, position


def _take(data: bytes, position: int, size: int) -> tuple[bytes, int]:
    end = position + size
    if end > len(data):
        raise DecodeError("too_short", f"ends after {len(data)} bytes, {end} needed")
    return data[position:end], end
