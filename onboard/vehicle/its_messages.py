"""The messages of ITS-G5 as values of the cores."""

from collections.abc import Callable, Mapping
from functools import lru_cache

from typing_extensions import override

from onboard.bsm_transmission.cam_schedule import MINIMUM_INTERVAL_S
from onboard.errors import DecodeError
from onboard.its_g5.awareness import bsm_of, cam_of
from onboard.its_g5.infrastructure import decode_map, decode_spat
from onboard.its_g5.notification import EventReports, ReceivedEvents
from onboard.its_g5.permissions import check_cam, check_denm
from onboard.its_g5.road_users import bsm_of_vam
from onboard.its_g5.stations import Stations
from onboard.messages import cam, cpm, denm, vam
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.cam import Cam
from onboard.messages.cpm import CollectivePerceptionMessage
from onboard.vehicle.message_set import Encoded, MessageSet
from onboard.vehicle.vehicle import ReceivedMessage, SharedMessage
from onboard.wave_udp import psid

_ROUNDING_S = 1e-6
LOW_FREQUENCY_S = 0.5
"""Least time between two low frequency containers of CAMs (EN 302 637-2 V1.4.1, 6.1.3)."""


class ItsMessages(MessageSet):
    """ETSI ITS: CAM, DENM for events of vehicles, VAM, CPM, MAPEM and SPATEM."""

    components: Mapping[int, str] = {
        psid.CAM: "cam",
        psid.DENM: "denm",
        psid.VAM: "vam",
        psid.CPM: "cpm",
        psid.MAPEM: "mapem",
        psid.SPATEM: "spatem",
    }

    _DECODERS: Mapping[int, Callable[[bytes], ReceivedMessage]] = {
        psid.MAPEM: lru_cache(maxsize=8)(decode_map),  # as of J2735's
        psid.SPATEM: decode_spat,
        psid.CPM: cpm.decode,
    }

    def __init__(self) -> None:
        """Start with nothing sent and nothing received."""
        self._low_frequency_at = self._cam_at = float("-inf")
        self._reports = EventReports()
        self._events = ReceivedEvents()
        self._stations = Stations()

    @override
    def encode(
        self, message: BasicSafetyMessage | SharedMessage, now: float, utc_s: float
    ) -> list[Encoded]:
        if isinstance(message, CollectivePerceptionMessage):
            return [Encoded(psid.CPM, cpm.encode(message), message.user_priority)]
        if not isinstance(message, BasicSafetyMessage):
            return []
        reports = self._reports.messages(message, now, utc_s)
        encoded = [Encoded(psid.DENM, denm.encode(each), each.user_priority) for each in reports]
        if now >= self._cam_at:
            self._cam_at = now + MINIMUM_INTERVAL_S - _ROUNDING_S
            encoded.append(self._cam(message, now, utc_s))
        return encoded

    def _cam(self, message: BasicSafetyMessage, now: float, utc_s: float) -> Encoded:
        has_low = now >= self._low_frequency_at
        if has_low:
            self._low_frequency_at = now + LOW_FREQUENCY_S
        data = cam.encode(cam_of(message, utc_s, low_frequency=has_low))
        return Encoded(psid.CAM, data, Cam.user_priority)

    @override
    def decode(
        self,
        service: int,
        data: bytes,
        signer_id: bytes | None,
        utc_s: float,
        ssp: bytes | None = None,
    ) -> ReceivedMessage | None:
        if service in self._DECODERS:
            return self._DECODERS[service](data)
        if service == psid.VAM:
            return bsm_of_vam(vam.decode(data), utc_s)
        if service == psid.DENM:
            notification = denm.decode(data)
            if signer_id is not None:
                check_denm(notification, ssp)
            event = self._events.bsm_of(notification, signer_id, utc_s)
            return None if event is None else self._stations.completed(event, signer_id, utc_s)
        message = cam.decode(data)
        if signer_id is not None:
            check_cam(message, ssp)
        vehicle = bsm_of(message, utc_s)
        if vehicle is None:
            name = message.parameters.high_frequency.name
            raise DecodeError("not_of_a_vehicle", str(name))
        if message.parameters.low_frequency is not None:
            self._stations.receive_whole(vehicle, signer_id, utc_s)
            return vehicle
        return self._stations.completed(vehicle, signer_id, utc_s)
