"""Whole vehicles whose certificates commit to their IDs, and an insider among them."""

import numpy as np

from onboard.messages import lcca
from onboard.messages.lcca import CarId, LccaMessage, LccaPdu
from onboard.observations import HardBrake
from onboard.security import ieee1609dot2
from onboard.security.credentials import Credentials
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import Pseudonym, Pseudonyms
from onboard.security.security_services import SecurityServices
from onboard.security.settings import PlateDigestSettings
from onboard.step import Input, ReceivedWsm
from onboard.trace.trace_line import as_record
from onboard.vehicle.stack import Stack
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage
from tests.security.trial import UTC_S, credentials_of
from tests.vehicle.platoon import SPEED_M_S, Platoon, car

PLATES = ("AAA1", "BBB2", "CCC3")
EVIL = "EVIL9"


class Insider:
    """A radio with certificates of its own plate."""

    def __init__(
        self, epoch_s: float = 300.0, keys: Credentials | None = None, plate: str = EVIL
    ) -> None:
        digest = PlateDigest(PlateDigestSettings(scrypt_log2_n=1, epoch_s=epoch_s))
        self.keys = keys or credentials_of(plate, epoch_s)
        self._security = SecurityServices(UTC_S, self.keys)
        self._pseudonyms = Pseudonyms(plate, digest, self.keys, np.random.default_rng(9))

    def pseudonym(self, now: float) -> Pseudonym:
        return self._pseudonyms.at(UTC_S + now)

    def wsm(
        self,
        message: LccaMessage,
        now: float,
        proof: tuple[bytes, ...] | None = None,
        origin: bytes = b"",
        *,
        cut: int = 0,
    ) -> ReceivedWsm:
        """A signed message, with the proof of the own ID unless another one is given.

        Of its last bytes, `cut` are not signed.
        """
        pseudonym = self.pseudonym(now)
        assert pseudonym.credential is not None
        self._security.sign_with(pseudonym.credential)
        payload = lcca.encode(message, pseudonym.proof if proof is None else proof, origin)
        payload = payload[: len(payload) - cut]
        secured = self._security.secure(payload, psid.LCCA, now)
        return ReceivedWsm(now, wsmp.encode(WaveShortMessage(psid.LCCA, secured)))


def driven(
    epoch_s: float = 300.0, *, reach: int = 1000, beacons: bool = True, start_s: float = 0.0
) -> Platoon:
    """Three vehicles that have formed a group; `start_s` after `UTC_S`."""
    platoon = Platoon(
        {
            plate: car(
                plate,
                epoch_s,
                credentials_of(plate, epoch_s),
                UTC_S + start_s,
                seed,
                beacons=beacons,
            )
            for seed, plate in enumerate(PLATES)
        },
        reach,
    )
    platoon.drive(3.0)
    return platoon


def stack_of(platoon: Platoon, plate: str) -> Stack:
    return platoon.cars[plate]


def car_id(platoon: Platoon, plate: str, at_s: float | None = None) -> CarId:
    at_s = platoon.now if at_s is None else at_s
    return stack_of(platoon, plate).digest.car_id(plate, UTC_S + at_s)


def reasons(platoon: Platoon, plate: str) -> list[str]:
    return [as_record(event)["reason"] for event in platoon.events_of(plate, "discarded")]


def brakes(platoon: Platoon, plate: str) -> None:
    platoon.speed_m_s[plate] = SPEED_M_S - 1.0
    platoon.drive(0.1)
    platoon.receive(plate, HardBrake(platoon.now, 7.0, source="obd"))
    platoon.settle()


def warned(platoon: Platoon) -> list[str]:
    return [plate for plate in PLATES if list(platoon.events_of(plate, "warning"))]


def secured_in(received: ReceivedWsm) -> bytes:
    """The 1609.2 data in a frame."""
    return wsmp.decode(received.data).payload


def pdu_in(wsm: bytes) -> LccaPdu | None:
    """The LCCA message in a frame; `None` if there is none."""
    frame = wsmp.decode(wsm)
    if frame.psid != psid.LCCA:
        return None
    return lcca.decode(ieee1609dot2.decode(frame.payload).payload)


def message_in(received: Input) -> LccaMessage | None:
    """The LCCA message in an input; `None` if there is none."""
    pdu = pdu_in(received.data) if isinstance(received, ReceivedWsm) else None
    return None if pdu is None else pdu.message
