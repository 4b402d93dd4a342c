"""Headers of a radio profile: around messages that are signed, and around what is signed."""

from typing import Protocol

from typing_extensions import override

from onboard.messages import bsm
from onboard.security import ieee1609dot2
from onboard.security.ieee1609dot2 import Location
from onboard.security.pseudonyms import Pseudonym
from onboard.security.security_services import CERTIFICATE_INTERVAL_S
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage


class RadioFraming(Protocol):
    """Makes frames and reads them. A frame, once read, is a service and its 1609.2 data."""

    component: str
    """Which discards frames that cannot be read."""
    certificate_interval_s: float
    """Longest time between awareness messages that carry the certificate."""
    distributes: bool
    """Whether vehicles ask each other for certificates of authorities."""

    def use_pseudonym(self, pseudonym: Pseudonym) -> None:
        """Send under its identifiers from now on."""

    def signed_part(
        self, payload: bytes, service: int, user_priority: int, now: float, utc_s: float
    ) -> bytes:
        """Return what is signed of a message that is sent at `now`, which is `utc_s`."""

    def location(self, service: int, now: float) -> Location | None:
        """Return where a message is generated at `now`, if its header is to say so."""

    def frame(self, service: int, secured: bytes) -> bytes:
        """Return the frame around 1609.2 data."""

    def read(self, frame: bytes) -> WaveShortMessage:
        """Return service and 1609.2 data. Raises `DecodeError`."""

    def payload_in(self, signed_part: bytes, now: float) -> bytes:
        """Return the message in what was signed, if it is for here. Raises `DecodeError`."""

    def sender_of(self, message: WaveShortMessage) -> bytes | None:
        """Return the temporary ID in an awareness message, unverified; `None` without one."""

    def may_wait(self, message: WaveShortMessage) -> bool:
        """Whether it is an awareness message that tells of no event, unverified."""


class WaveFraming(RadioFraming):
    """WSMP: the message itself is signed."""

    component = "wsmp"
    certificate_interval_s = CERTIFICATE_INTERVAL_S
    distributes = True

    @override
    def use_pseudonym(self, pseudonym: Pseudonym) -> None:
        pass

    @override
    def signed_part(
        self, payload: bytes, service: int, user_priority: int, now: float, utc_s: float
    ) -> bytes:
        return payload

    @override
    def location(self, service: int, now: float) -> Location | None:
        return None

    @override
    def frame(self, service: int, secured: bytes) -> bytes:
        return wsmp.encode(WaveShortMessage(service, secured))

    @override
    def read(self, frame: bytes) -> WaveShortMessage:
        return wsmp.decode(frame)

    @override
    def payload_in(self, signed_part: bytes, now: float) -> bytes:
        return signed_part

    @override
    def sender_of(self, message: WaveShortMessage) -> bytes | None:
        return bsm_sender(message)

    @override
    def may_wait(self, message: WaveShortMessage) -> bool:
        return is_plain_bsm(message)


def bsm_sender(wsm: WaveShortMessage) -> bytes | None:
    """Return the temporary ID of the BSM in `wsm`, unverified; `None` if it carries no BSM."""
    payload = _bsm_in(wsm)
    return None if payload is None else bsm.temporary_id_in(payload)


def is_plain_bsm(wsm: WaveShortMessage) -> bool:
    """Return whether `wsm` carries a BSM without event flags, unverified."""
    payload = _bsm_in(wsm)
    return payload is not None and not bsm.may_tell_event(payload)


def _bsm_in(wsm: WaveShortMessage) -> bytes | None:
    return ieee1609dot2.payload_in(wsm.payload) if wsm.psid == psid.BSM else None
