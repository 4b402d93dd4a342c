"""The messages of a radio profile: what a vehicle sends and receives beside those of LCCA.

The cores exchange the same values in each profile.
"""

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import NamedTuple, Protocol

from typing_extensions import override

from onboard.errors import DecodeError
from onboard.its_g5.awareness import bsm_of, cam_of
from onboard.messages import bsm, cam, map_data, sdsm, spat
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.cam import Cam
from onboard.messages.sdsm import SensorDataSharingMessage
from onboard.vehicle.vehicle import ReceivedMessage
from onboard.wave_udp import psid


class Encoded(NamedTuple):
    """A message to send."""

    service: int
    """PSID or ITS-AID."""
    data: bytes
    user_priority: int


class MessageSet(Protocol):
    """Encodes and decodes the messages."""

    components: Mapping[int, str]
    """By service, which discards messages that cannot be decoded."""

    def encode(
        self, message: BasicSafetyMessage | SensorDataSharingMessage, now: float, utc_s: float
    ) -> Encoded | None:
        """Return a message at `now`, which is `utc_s`; `None` if the profile does not have it."""

    def decode(self, service: int, data: bytes, utc_s: float) -> ReceivedMessage:
        """Return a message received at `utc_s`. Raises `DecodeError`."""


class J2735Messages(MessageSet):
    """SAE J2735: BSM, SDSM, MAP and SPAT."""

    components: Mapping[int, str] = {
        psid.BSM: "bsm",
        psid.SENSOR_SHARING: "sdsm",
        psid.MAP: "map",
        psid.SPAT: "spat",
    }

    _DECODERS: Mapping[int, Callable[[bytes], ReceivedMessage]] = {
        psid.BSM: bsm.decode,
        psid.SENSOR_SHARING: sdsm.decode,
        # A road-side unit repeats its MAP message every second; a large one takes some ms.
        psid.MAP: lru_cache(maxsize=8)(map_data.decode),
        psid.SPAT: spat.decode,
    }

    @override
    def encode(
        self, message: BasicSafetyMessage | SensorDataSharingMessage, now: float, utc_s: float
    ) -> Encoded | None:
        if isinstance(message, BasicSafetyMessage):
            return Encoded(psid.BSM, bsm.encode(message), message.user_priority)
        return Encoded(psid.SENSOR_SHARING, sdsm.encode(message), message.user_priority)

    @override
    def decode(self, service: int, data: bytes, utc_s: float) -> ReceivedMessage:
        return self._DECODERS[service](data)


LOW_FREQUENCY_S = 0.5
"""Least time between two low frequency containers of CAMs (EN 302 637-2 V1.4.1, 6.1.3)."""


class ItsMessages(MessageSet):
    """ETSI ITS: the CAM."""

    components: Mapping[int, str] = {psid.CAM: "cam"}

    def __init__(self) -> None:
        self._low_frequency_at = float("-inf")

    @override
    def encode(
        self, message: BasicSafetyMessage | SensorDataSharingMessage, now: float, utc_s: float
    ) -> Encoded | None:
        if not isinstance(message, BasicSafetyMessage):
            return None
        has_low = now >= self._low_frequency_at
        if has_low:
            self._low_frequency_at = now + LOW_FREQUENCY_S
        data = cam.encode(cam_of(message, utc_s, low_frequency=has_low))
        return Encoded(psid.CAM, data, Cam.user_priority)

    @override
    def decode(self, service: int, data: bytes, utc_s: float) -> ReceivedMessage:
        message = cam.decode(data)
        vehicle = bsm_of(message, utc_s)
        if vehicle is None:
            name = message.parameters.high_frequency.name
            raise DecodeError("not_of_a_vehicle", str(name))
        return vehicle
