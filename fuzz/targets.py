"""The decoders under fuzzing: a target takes any bytes and raises only declared exceptions."""

import struct
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from onboard.detector.object_list import ObjectListReader
from onboard.errors import DecodeError
from onboard.gnss.gpsd_reader import GpsdReader
from onboard.gnss.nmea import NmeaReader
from onboard.hmi.access_check import AccessCheck
from onboard.its_g5 import packet
from onboard.its_g5.infrastructure import decode_map, decode_spat, encode_map, encode_spat
from onboard.messages import bsm, cam, cpm, denm, lcca, map_data, mvs_footer, psm, sdsm, spat, vam
from onboard.mvs.cpm_coding import entries_in
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.settings import MvsSettings
from onboard.obd.can_frame import CanFrame
from onboard.obd.settings import ObdSettings
from onboard.obd.socketcand import ProtocolError, parse_element
from onboard.obd.vehicle_bus import VehicleBus
from onboard.observations import Position
from onboard.security import p256
from onboard.security.oer import Malformed, Unsupported
from onboard.security.peer_to_peer import decode_ca_certs
from onboard.security.plate_digest import PlateDigest
from onboard.security.security_services import NotTrusted, Opened, SecurityServices
from onboard.security.settings import PlateDigestSettings
from onboard.settings import SettingsError, parse_settings, parse_yaml
from onboard.tools.decode.describe import describe
from onboard.tools.test_ca.authority import make_trial
from onboard.vehicle.config import CarConfig
from onboard.vehicle.framing import bsm_sender
from onboard.vehicle.lcca_link import LccaLink, RefusalError
from onboard.vision import jpeg
from onboard.vision.mjpeg import MjpegParts
from onboard.wave_udp import immediate_forward, psid, wsmp
from onboard.wave_udp.capture import CaptureError, read_capture
from onboard.wave_udp.receive_queue import ReceiveQueue
from onboard.wave_udp.wsmp import WaveShortMessage


@dataclass(frozen=True, slots=True)
class Target:
    """One decoder."""

    read: Callable[[bytes], object]
    declared: tuple[type[Exception], ...] = ()
    max_s_per_kilobyte: float = 1e-3
    """Time allowed for a kilobyte, and for any shorter input."""

    def feed(self, data: bytes) -> None:
        """Decode `data`; raise exceptions that the target does not declare."""
        with suppress(*self.declared):
            self.read(data)


def _codec(
    decode: Callable[[bytes], Any],
    encode: Callable[[Any], bytes],
    max_s_per_kilobyte: float = 1e-3,
) -> Target:
    """Return a target that decodes, encodes and decodes again."""

    def read(data: bytes) -> None:
        message = decode(data)
        if decode(encode(message)) != message:
            raise AssertionError(f"{message} is not what its encoding decodes to")

    return Target(read, (DecodeError,), max_s_per_kilobyte)


def _decode_version_3(data: bytes) -> WaveShortMessage:
    """Decode a WSM as version 3, since version 2 is never encoded."""
    return replace(wsmp.decode(data), version=wsmp.VERSION)


def _encode_lcca(pdu: lcca.LccaPdu) -> bytes:
    return lcca.encode(pdu.message, pdu.proof, pdu.origin)


_UTC_S = 1_790_000_000.0
_TRIAL = make_trial(
    ["receiver", "sender"], [psid.BSM], _UTC_S, p256.key_from(np.random.default_rng(1609))
)
_SECURITY = SecurityServices(_UTC_S, _TRIAL["receiver"])
"""A receiver that trusts the sender of the corpus."""


_COPY = lcca.Warn(
    b"copies--", b"origin--", 2, b"origin--", 7, 1, 1, 7, lcca.WarnCause.DECELERATION, 6.0, 0.0, 2
)
"""A copy of the warning in the corpus."""


def _lcca_origin(data: bytes) -> None:
    """What a copy of a warning says that its braking vehicle signed."""
    link = LccaLink(_SECURITY, psid.BSM, None, PlateDigest(PlateDigestSettings()))
    opened = Opened(b"", b"signer--", _UTC_S)
    message, _ = link.receive_pdu(lcca.LccaPdu(_COPY, origin=data), opened, None, now=0.0)
    link.encode(message)


def _geonetworking(data: bytes) -> None:
    """A frame of ITS-G5, down to its payload."""
    header, content = packet.read_basic_header(data)
    packet.check_hops(header, content)
    packet.port_in(content)
    read = packet.decode(content)
    if packet.decode(packet.encode(read)) != read:
        raise AssertionError(f"{read} is not what its encoding decodes to")


def _cpm(data: bytes) -> None:
    """A CPM, down to the evidence in it."""
    message = cpm.decode(data)
    if cpm.decode(cpm.encode(message)) != message:
        raise AssertionError(f"{message} is not what its encoding decodes to")
    entries_in(message)


def _security(data: bytes) -> object:
    return _SECURITY.open(data, psid.BSM, now=0.0)


def _capture(data: bytes) -> None:
    for _ in read_capture(data):
        pass


_CAN_FRAME = struct.Struct("<IB3x8s")


def _can(data: bytes) -> None:
    """Frames as SocketCAN lays them out (struct can_frame), 0.1 s apart."""
    bus = VehicleBus(ObdSettings())
    for number in range(len(data) // _CAN_FRAME.size):
        now = number * 0.1
        identifier, size, content = _CAN_FRAME.unpack_from(data, number * _CAN_FRAME.size)
        is_extended_id = bool(identifier >> 31)
        identifier &= 0x1FFFFFFF if is_extended_id else 0x7FF
        bus.receive_frame(CanFrame(now, identifier, is_extended_id, content[:size]), now)
        bus.frames_to_send(now)
        while bus.next_event() is not None:
            pass


def _socketcand(data: bytes) -> object:
    return parse_element(data.decode("latin-1"))


def _nmea(data: bytes) -> None:
    _read_stream(NmeaReader(), data)


def _gpsd(data: bytes) -> None:
    _read_stream(GpsdReader(), data)


def _read_stream(reader: NmeaReader | GpsdReader, data: bytes) -> None:
    """Read `data` in two pieces, as from a stream."""
    half = len(data) // 2
    for now, piece in enumerate((data[:half], data[half:])):
        reader.receive_bytes(piece, float(now))
        while reader.next_event() is not None:
            pass


_MOST_DATAGRAMS = 64
"""So many take less time than one that is as long as they are together may."""


def _detector(data: bytes) -> None:
    """Lines as datagrams, 0.1 s apart; the last one has what is left."""
    reader = ObjectListReader()
    for number, line in enumerate(data.split(b"\n", _MOST_DATAGRAMS - 1)):
        reader.receive_bytes(line, number * 0.1)
        while reader.next_event() is not None:
            pass


def _jpeg(data: bytes) -> None:
    jpeg.pixels(data)
    jpeg.is_whole(data)


def _mjpeg(data: bytes) -> None:
    parts = MjpegParts(b"frame")
    half = len(data) // 2
    for piece in (data[:half], data[half:]):
        parts.receive_bytes(piece)
        while parts.next_body() is not None:
            pass


def _yaml(data: bytes) -> None:
    tree = parse_yaml(data, "fuzz")
    parse_settings({} if tree is None else tree, CarConfig, "fuzz")


_TOKEN = "a token of sixteen"  # noqa: S105 (guards nothing)


def _http(data: bytes) -> None:
    """Lines as the headers Host, Origin, cookie and Authorization; empty: not sent."""
    lines = data.decode("utf-8", "surrogateescape").split("\n")[:4]
    host, *others = lines + [""] * (4 - len(lines))
    origin, cookie, authorization = (each or None for each in others)
    AccessCheck(None).refusal(host, origin, cookie, authorization)
    refusal = AccessCheck(_TOKEN).refusal(host, origin, cookie, authorization)
    if refusal is None and _TOKEN not in (cookie, (authorization or "").removeprefix("Bearer ")):
        raise AssertionError("accepted without the token")


def _known_signer(wsm: WaveShortMessage) -> bytes | None:
    return wsm.payload[:1] if wsm.payload[-1:] > b"\x40" else None


def _receive_queue(data: bytes) -> None:
    """Frames, each after its size in one byte; some are of known signers."""
    queue = ReceiveQueue(psid.LCCA, bsm_sender, _known_signer)
    put = taken = position = 0
    while position < len(data):
        end = position + 1 + data[position]
        queue.put(data[position + 1 : end])
        position, put = end, put + 1
    while queue.take() is not None or queue.take_unknown() is not None:
        taken += 1
    if taken + queue.take_dropped() != put:
        raise AssertionError(f"{put} frames put, {taken} taken")


_MOST_FOOTERS = 3
"""As many as the corpus's own input has: own footers and tracks follow from two already."""


def _footer_sharing(data: bytes) -> None:
    """Footers of a remote vehicle, each after its size in two bytes, 0.1 s apart.

    Those that are refused are not followed by an update, which takes ten times as long as to read
    them.
    """
    mvs = MultiVehicleSensing(MvsSettings(), b"host", np.random.default_rng(1), _UTC_S)
    position = number = accepted = 0
    while position < len(data) and number < _MOST_FOOTERS:
        now = 0.1 * number
        end = position + 2 + int.from_bytes(data[position : position + 2])
        mvs.receive_position(Position(now, 48.1, 11.5, None, 0.5, 10.0, 0.0))
        remote = Position(now, 48.1005, 11.5, None, 0.5, 10.0, 0.0)
        mvs.receive_bsm(b"seen", remote, data[position + 2 : end], now)
        if mvs.next_event() is None:
            mvs.update(now)
            accepted += 1
        position, number = end, number + 1
    if accepted:
        mvs.kinematic_info(0.1 * number)
        mvs.footer_to_send(0.1 * number)


TARGETS = {
    "wsmp": _codec(_decode_version_3, wsmp.encode),
    "rsu41": _codec(immediate_forward.decode, immediate_forward.encode),
    "capture": Target(_capture, (CaptureError,)),
    "describe": Target(describe),
    "ieee1609dot2": Target(_security, (NotTrusted,)),
    "peer_to_peer": Target(decode_ca_certs, (Malformed, Unsupported)),
    "bsm": _codec(bsm.decode, bsm.encode),
    "cam": _codec(cam.decode, cam.encode),
    "cpm": Target(_cpm, (DecodeError,), max_s_per_kilobyte=2e-2),
    "mapem": _codec(decode_map, partial(encode_map, station_id=b"unit"), 4e-2),
    "spatem": _codec(decode_spat, partial(encode_spat, station_id=b"unit"), 2e-2),
    "denm": _codec(denm.decode, denm.encode),
    "vam": _codec(vam.decode, vam.encode),
    "psm": _codec(psm.decode, psm.encode),
    "geonetworking": Target(_geonetworking, (DecodeError,)),
    "map": _codec(map_data.decode, map_data.encode, 4e-2),  # a kilobyte has 300 nodes of a lane
    "spat": _codec(spat.decode, spat.encode, 2e-2),
    "sdsm": _codec(sdsm.decode, sdsm.encode, 2e-2),
    "mvs_footer": _codec(mvs_footer.decode, mvs_footer.encode),
    "lcca": _codec(lcca.decode, _encode_lcca),
    "lcca_origin": Target(_lcca_origin, (RefusalError,)),
    "can": Target(_can, max_s_per_kilobyte=5e-3),  # 62 frames through the brake detector too
    "nmea": Target(_nmea),
    "gpsd": Target(_gpsd),
    "socketcand": Target(_socketcand, (ProtocolError,)),
    "detector": Target(_detector),
    "jpeg": Target(_jpeg),
    "mjpeg": Target(_mjpeg, max_s_per_kilobyte=2e-2),
    "http": Target(_http),
    "receive_queue": Target(_receive_queue, max_s_per_kilobyte=1e-2),
    "footer_sharing": Target(_footer_sharing, max_s_per_kilobyte=1e-1),
    "yaml": Target(_yaml, (SettingsError,), max_s_per_kilobyte=1e-1),
}
"""By the name of their corpus."""
