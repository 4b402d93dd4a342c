"""ITS-G5: the message with BTP and all of GeoNetworking but the basic header is signed."""

import math
from collections.abc import Callable

from typing_extensions import override

from onboard.errors import DecodeError
from onboard.its_g5 import packet, ports
from onboard.its_g5.awareness import ELLIPSE_SIGMAS
from onboard.its_g5.headers import LongPositionVector, NextHeader
from onboard.its_g5.its_timestamp import timestamp_ms
from onboard.its_g5.packet import GeoPacket
from onboard.messages import cam
from onboard.messages.its_common import PASSENGER_CAR
from onboard.observations import Position
from onboard.security import ieee1609dot2
from onboard.security.pseudonyms import Pseudonym
from onboard.vehicle.framing import RadioFraming
from onboard.wave_udp import psid
from onboard.wave_udp.wsmp import WaveShortMessage

ACCURATE_M = 40.0
"""Half axis of the 95 % ellipse below which a position is called accurate: half of itsGnPaiInterval
(EN 302 636-4-1, annex H)."""
TRAFFIC_CLASSES = (2, 3, 3, 2, 1, 1, 0, 0)
"""DCC profile by user priority (TS 102 636-4-2, by access category)."""
_LOCALLY_ADMINISTERED = bytes((0x02, 0x00))


class ItsG5Framing(RadioFraming):
    """GeoNetworking packets to whoever receives them."""

    component = "geonetworking"
    certificate_interval_s = 1.0
    """TS 103 097 V1.3.1, 7.1.1."""
    distributes = False

    def __init__(self, lcca_psid: int, position: Callable[[float], Position | None]) -> None:
        """Frame messages of the standard's services, and of LCCA under `lcca_psid`.

        Args:
            lcca_psid: of LCCA messages.
            position: last fix of the host vehicle at a `now`.
        """
        self._ports = {**ports.OF_SERVICES, lcca_psid: ports.LCCA}
        self._services = {port: service for service, port in self._ports.items()}
        self._position = position
        self._mac = bytes(6)

    @override
    def use_pseudonym(self, pseudonym: Pseudonym) -> None:
        self._mac = _LOCALLY_ADMINISTERED + pseudonym.temporary_id

    @override
    def signed_part(
        self, payload: bytes, service: int, user_priority: int, now: float, utc_s: float
    ) -> bytes:
        source, traffic_class = self._source(now, utc_s - now), TRAFFIC_CLASSES[user_priority]
        return packet.encode(GeoPacket(self._ports[service], payload, source, traffic_class))

    @override
    def frame(self, service: int, secured: bytes) -> bytes:
        is_signed = ieee1609dot2.is_signed(secured)
        content = secured if is_signed else ieee1609dot2.payload_in(secured) or b""
        return packet.with_basic_header(content, is_secured=is_signed)

    @override
    def read(self, frame: bytes) -> WaveShortMessage:
        header, rest = packet.read_basic_header(frame)
        is_secured = header.next_header is NextHeader.SECURED
        content = (ieee1609dot2.payload_in(rest) or b"") if is_secured else rest
        packet.check_hops(header, content)
        port = packet.port_in(content)
        if port is None:
            raise DecodeError("too_short", "ends before the port")
        service = self._services.get(port)
        if service is None:
            raise DecodeError("unknown_port", str(port))
        return WaveShortMessage(
            service, rest if is_secured else ieee1609dot2.encode_unsecured(content)
        )

    @override
    def payload_in(self, signed_part: bytes) -> bytes:
        return packet.decode(signed_part).payload

    @override
    def sender_of(self, message: WaveShortMessage) -> bytes | None:
        content = ieee1609dot2.payload_in(message.payload) if message.psid == psid.CAM else None
        return None if content is None else cam.station_id_in(packet.payload_in(content))

    def _source(self, now: float, utc_offset_s: float) -> LongPositionVector:
        """Return who sends and where; without a fix the position is 0, and not accurate."""
        fix = self._position(now)
        stamp_s = now if fix is None else fix.stamp_s
        timestamp = timestamp_ms(stamp_s + utc_offset_s) & 0xFFFF_FFFF
        address = True, PASSENGER_CAR, 0, self._mac, timestamp
        if fix is None:
            return LongPositionVector(*address, 0.0, 0.0, False, 0.0, 0.0)
        return LongPositionVector(
            *address,
            fix.latitude_deg,
            fix.longitude_deg,
            fix.sigma_m * ELLIPSE_SIGMAS < ACCURATE_M,
            fix.speed_m_s or 0.0,
            (fix.course_rad or 0.0) % math.tau,
        )
