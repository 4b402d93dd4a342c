"""The messages of a radio profile: what a vehicle sends and receives beside those of LCCA.

The cores exchange the same values in each profile. Those of WAVE are here; those of ITS-G5 are in
a file of their own, which is imported by whoever sends them: a start without it is sooner.
"""

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import NamedTuple, Protocol

from typing_extensions import override

from onboard.messages import bsm, map_data, psm, sdsm, spat
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.psm_as_bsm import bsm_of_psm
from onboard.messages.sdsm import SensorDataSharingMessage
from onboard.vehicle.vehicle import ReceivedMessage, SharedMessage
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
        self, message: BasicSafetyMessage | SharedMessage, now: float, utc_s: float
    ) -> list[Encoded]:
        """Return what says a message at `now`, which is `utc_s`."""

    def decode(
        self,
        service: int,
        data: bytes,
        signer_id: bytes | None,
        utc_s: float,
        ssp: bytes | None = None,
    ) -> ReceivedMessage | None:
        """Return a message; `None` if it says nothing new.

        Args:
            service: PSID or ITS-AID.
            data: the message.
            signer_id: HashedId8 of its signer; `None` if it is not signed, which permits all.
            utc_s: time of reception.
            ssp: of the service in the signer's certificate.

        Raises:
            DecodeError: it cannot be decoded or used, or its signer may not say it.
        """


class J2735Messages(MessageSet):
    """SAE J2735: BSM, PSM, SDSM, MAP and SPAT."""

    components: Mapping[int, str] = {
        psid.BSM: "bsm",
        psid.PSM: "psm",
        psid.SENSOR_SHARING: "sdsm",
        psid.MAP: "map",
        psid.SPAT: "spat",
    }

    _DECODERS: Mapping[int, Callable[[bytes], ReceivedMessage]] = {
        psid.BSM: bsm.decode,
        psid.PSM: lambda data: bsm_of_psm(psm.decode(data)),
        psid.SENSOR_SHARING: sdsm.decode,
        # A road-side unit repeats its MAP message every second; a large one takes some ms.
        psid.MAP: lru_cache(maxsize=8)(map_data.decode),
        psid.SPAT: spat.decode,
    }

    @override
    def encode(
        self, message: BasicSafetyMessage | SharedMessage, now: float, utc_s: float
    ) -> list[Encoded]:
        if isinstance(message, BasicSafetyMessage):
            return [Encoded(psid.BSM, bsm.encode(message), message.user_priority)]
        if not isinstance(message, SensorDataSharingMessage):
            return []
        return [Encoded(psid.SENSOR_SHARING, sdsm.encode(message), message.user_priority)]

    @override
    def decode(
        self,
        service: int,
        data: bytes,
        signer_id: bytes | None,
        utc_s: float,
        ssp: bytes | None = None,
    ) -> ReceivedMessage | None:
        return self._DECODERS[service](data)
