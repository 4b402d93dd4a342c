"""An outsider without keys floods two vehicles, whose authorities differ, with certificates.

Each vehicle has its radio link, and a queue of which it can open `SERVED_HZ` frames of unknown
signers a second: what the daemon's share of time allows on a slow processor.
"""

import itertools
from collections.abc import Callable, Iterator

import pytest

from onboard.security.credentials import Credentials
from onboard.security.ieee1609dot2 import encode_signed, encode_to_be_signed
from onboard.security.its_time import to_time64
from onboard.security.security_services import SecurityServices
from onboard.vehicle.wave_link import WaveLink, bsm_sender, certificate_in
from onboard.wave_udp import psid
from onboard.wave_udp.receive_queue import ReceiveQueue
from onboard.wave_udp.wsmp import WaveShortMessage, encode
from tests.security.test_peer_to_peer import STRANGER
from tests.security.trial import ALICE, UTC_S

FLOOD_HZ = 3000
SERVED_HZ = 1500
TICK_S = 0.01
MET_S = 3.0
"""After which the vehicles, flooded all the time, come into each other's range."""
LEARNT_S = 2.0

REAL = STRANGER.pseudonyms[0].certificate


class Vehicle:
    """Security, radio link and queue of a vehicle that sends ten BSMs a second."""

    def __init__(self, credentials: Credentials, phase_s: float) -> None:
        self.link = WaveLink(SecurityServices(UTC_S, credentials), psid.J2735)
        self.queue = ReceiveQueue(psid.LCCA, bsm_sender, self.link.known_signer, certificate_in)
        self.accepted_at: list[float] = []
        self._next_bsm_at = MET_S + phase_s

    def wsms_to_send(self, now: float) -> Iterator[bytes]:
        if now >= self._next_bsm_at:
            self._next_bsm_at += 0.1
            self.link.submit(b"bsm", psid.BSM, 5, 0.1, now)
        return (wsm for _, wsm in self.link.wsms_to_send(now))

    def receive_for(self, seconds: float, now: float) -> None:
        unknown = itertools.islice(iter(self.queue.take_unknown, None), round(seconds * SERVED_HZ))
        for wsm in itertools.chain(iter(self.queue.take, None), list(unknown)):
            if self.link.receive_wsm(wsm, now) is not None:
                self.accepted_at.append(now)


def forged(number: int, now: float) -> bytes:
    """A BSM under a certificate of an issuer that nobody knows, signed with nothing."""
    issuer = number.to_bytes(8)
    assert REAL.issuer_id is not None
    signer = b"\x81\x01\x01" + REAL.encoded.replace(REAL.issuer_id, issuer)
    head = encode_to_be_signed(b"bsm", psid.BSM, to_time64(UTC_S + now))
    signed = encode_signed(head, b"signer..", (1, 1)).replace(b"\x80signer..", signer)
    return encode(WaveShortMessage(psid.BSM, signed))


def always_others(number: int) -> int:
    return number


def the_same_again(number: int) -> int:
    """Of 1,500 issuers, each twice a second, as vehicles send."""
    return number % 1500


@pytest.mark.parametrize(
    ("rate_hz", "issuer"),
    [
        (0, always_others),
        (40, always_others),
        (FLOOD_HZ, always_others),
        (FLOOD_HZ, the_same_again),
    ],
)
def test_each_vehicle_learns_the_other_ones_issuer_within_two_seconds(
    rate_hz: int, issuer: Callable[[int], int]
) -> None:
    vehicles = [Vehicle(ALICE, 0.0), Vehicle(STRANGER, 0.05)]
    flooded = 0
    for tick in range(round((MET_S + LEARNT_S) / TICK_S)):
        now = tick * TICK_S
        while flooded < now * rate_hz:
            garbage = forged(issuer(flooded), now)
            for vehicle in vehicles:
                vehicle.queue.put(garbage)
            flooded += 1
        for vehicle, other in (vehicles, vehicles[::-1]):
            for wsm in vehicle.wsms_to_send(now):
                other.queue.put(wsm)
        for vehicle in vehicles:
            vehicle.receive_for(TICK_S, now)
    assert all(vehicle.accepted_at for vehicle in vehicles)
