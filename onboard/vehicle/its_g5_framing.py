"""ITS-G5: the message with BTP and all of GeoNetworking but the basic header is signed."""

import math
from collections.abc import Callable, Mapping

from typing_extensions import override

from onboard.errors import DecodeError
from onboard.its_g5 import packet, ports
from onboard.its_g5.area import CIRCLE, is_within
from onboard.its_g5.awareness import ELLIPSE_SIGMAS
from onboard.its_g5.headers import Area, LongPositionVector, NextHeader
from onboard.its_g5.its_timestamp import timestamp_ms
from onboard.its_g5.packet import GeoPacket
from onboard.kinematics.geodesy import point_ahead_deg
from onboard.messages import cam
from onboard.messages.its_common import PASSENGER_CAR
from onboard.observations import Position
from onboard.security import ieee1609dot2
from onboard.security.ieee1609dot2 import Location
from onboard.security.pseudonyms import Pseudonym
from onboard.sensors.host_state import PLACE_VALID_S
from onboard.vehicle.framing import RadioFraming
from onboard.wave_udp import psid
from onboard.wave_udp.wsmp import WaveShortMessage

ACCURATE_M = 40.0
"""Half axis of the 95 % ellipse below which a position is called accurate: half of itsGnPaiInterval
(EN 302 636-4-1, annex H)."""
TRAFFIC_CLASSES = (2, 3, 3, 2, 1, 1, 0, 0)
"""DCC profile by user priority (TS 102 636-4-2, by access category)."""
EVENT_RADIUS_M = 1_000
"""Of the area around the host vehicle to which its events are sent. Ours."""
EVENT_HOPS = 10
"""Of these packets: itsGnDefaultHopLimit (EN 302 636-4-1, annex H)."""
_LOCALLY_ADMINISTERED = bytes((0x02, 0x00))


class ItsG5Framing(RadioFraming):
    """GeoNetworking packets: of events to an area, of all else to whoever receives them."""

    component = "geonetworking"
    certificate_interval_s = 1.0
    """TS 103 097 V1.3.1, 7.1.1."""
    distributes = False

    def __init__(
        self,
        lcca_psid: int,
        position: Callable[[], Position | None],
        station_type: int = PASSENGER_CAR,
        others: Mapping[int, int] | None = None,
    ) -> None:
        """Frame messages of the standard's services, and of LCCA under `lcca_psid`.

        Args:
            lcca_psid: of LCCA messages.
            position: last fix of the host vehicle.
            station_type: in the address.
            others: ports of further services.
        """
        self._station_type = station_type
        self._ports = {**ports.OF_SERVICES, lcca_psid: ports.LCCA, **(others or {})}
        self._services = {port: service for service, port in self._ports.items()}
        self._position = position
        self._mac = bytes(6)
        self._sequence = 0

    @override
    def use_pseudonym(self, pseudonym: Pseudonym) -> None:
        self._mac = _LOCALLY_ADMINISTERED + pseudonym.temporary_id
        self._sequence = int.from_bytes(pseudonym.temporary_id[:2])

    @override
    def signed_part(
        self, payload: bytes, service: int, user_priority: int, now: float, utc_s: float
    ) -> bytes:
        fix = self._position()
        source, traffic_class = self._source(fix, now, utc_s), TRAFFIC_CLASSES[user_priority]
        port = self._ports[service]
        if service != psid.DENM or fix is None:
            return packet.encode(GeoPacket(port, payload, source, traffic_class))
        self._sequence = (self._sequence + 1) & 0xFFFF
        area = Area(*_place_at(fix, now), EVENT_RADIUS_M)
        return packet.encode(
            GeoPacket(
                port, payload, source, traffic_class, EVENT_HOPS, area, CIRCLE, self._sequence
            )
        )

    @override
    def location(self, service: int, now: float) -> Location | None:
        fix = self._position()
        if service != psid.DENM or fix is None:
            return None
        return Location(*_place_at(fix, now), fix.altitude_m or 0.0)

    @override
    def frame(self, service: int, secured: bytes) -> bytes:
        is_signed = ieee1609dot2.is_signed(secured)
        content = secured if is_signed else ieee1609dot2.payload_in(secured) or b""
        hops = 1 if service != psid.DENM or self._position() is None else EVENT_HOPS
        return packet.with_basic_header(content, is_secured=is_signed, hops=hops)

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
    def payload_in(self, signed_part: bytes, now: float) -> bytes:
        received, fix = packet.decode(signed_part), self._position()
        area = received.area
        if area is not None and fix is not None and now - fix.stamp_s <= PLACE_VALID_S:
            here = fix.latitude_deg, fix.longitude_deg
            if not is_within(area, received.shape, *here):
                raise DecodeError("outside_area", f"{area.distance_a_m} m")
        return received.payload

    @override
    def sender_of(self, message: WaveShortMessage) -> bytes | None:
        content = ieee1609dot2.payload_in(message.payload) if message.psid == psid.CAM else None
        return None if content is None else cam.station_id_in(packet.payload_in(content))

    @override
    def may_wait(self, message: WaveShortMessage) -> bool:
        return message.psid == psid.CAM  # events are in DENMs

    def _source(self, fix: Position | None, now: float, utc_s: float) -> LongPositionVector:
        """Return who sends and where; without a fix the position is 0, and not accurate."""
        age_s = 0.0 if fix is None else now - fix.stamp_s
        timestamp = timestamp_ms(utc_s - age_s) & 0xFFFF_FFFF
        address = True, self._station_type, 0, self._mac, timestamp
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


def _place_at(fix: Position, now: float) -> tuple[float, float]:
    """Return latitude and longitude at `now`: a fix is up to 1.6 s old, some 50 m at 30 m/s."""
    place = fix.latitude_deg, fix.longitude_deg
    if fix.speed_m_s is None or fix.course_rad is None:
        return place
    return point_ahead_deg(*place, fix.course_rad, fix.speed_m_s * max(now - fix.stamp_s, 0.0))
