"""Outsiders without keys who flood vehicles with certificates that they make up.

Two vehicles whose authorities differ meet again and again, each time without knowing the other's.
Flooded from the start, they come into range after `MEETS_S`. Each can open `SERVED_HZ` frames of
unknown signers a second, the share of time of the program on a slow processor. Under its link,
everything but the time of processing is the program's.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, islice

import numpy as np

from onboard.security.certificates import Certificate
from onboard.security.credentials import Credentials
from onboard.security.ieee1609dot2 import encode_signed, encode_to_be_signed
from onboard.security.its_time import to_time64
from onboard.security.oer import choice, sequence
from onboard.security.p256 import key_from
from onboard.security.security_services import SecurityServices
from onboard.tools.test_ca.authority import make_issuing, make_pseudonyms, make_root
from onboard.vehicle.framing import bsm_sender
from onboard.vehicle.wave_link import WaveLink
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.receive_queue import ReceiveQueue
from onboard.wave_udp.wsmp import WaveShortMessage
from sim_rig.studies.attacks.attack_counts import AttackCounts

FLOOD_HZ = 3000
"""Frames of all outsiders together, all that a channel of 6 Mbit/s carries."""
SERVED_HZ = 1500
TICK_S = 0.01
MEETS_S, LEARNS_S = 3.0, 2.0
"""Flooded for so long, the vehicles come into range; then each is to know the other in time."""


def run_certificate_flood(
    seed: tuple[int, ...], utc_s: float, seconds: float, outsiders: int
) -> AttackCounts:
    """Let two vehicles meet every `MEETS_S + LEARNS_S`.

    Args:
        seed: of the keys.
        utc_s: at the start, seconds since 1970.
        seconds: duration of the flood.
        outsiders: their number; together they fill the channel.

    Returns:
        Vehicles that are not known in time, as true alarms that are missed.
    """
    new_key = key_from(np.random.default_rng(seed))
    since_utc_s, valid_s = utc_s - 3600.0, 86_400.0
    root = make_root(
        "root", {psid.BSM}, valid_from_utc_s=since_utc_s, valid_for_s=valid_s, new_key=new_key
    )
    keys = []
    for name in ("one", "other"):
        issuing = make_issuing(
            root, name, valid_from_utc_s=since_utc_s, valid_for_s=valid_s, new_key=new_key
        )
        keys.append(
            make_pseudonyms(
                issuing,
                1,
                {psid.BSM},
                valid_from_utc_s=since_utc_s,
                valid_for_s=valid_s,
                new_key=new_key,
            )
        )
    meetings = int(seconds // (MEETS_S + LEARNS_S))
    flood = partial(made_up_by, outsiders)
    known = sum(count_known(keys, utc_s, flood, (*seed, at)) for at in range(meetings))
    return AttackCounts(
        false_alarms=0,
        false_alarm_s=0.0,
        ignored=0,
        true_alarms=2 * meetings,
        true_missed=2 * meetings - known,
    )


@dataclass(frozen=True, slots=True)
class MadeUp:
    """What distinguishes a certificate that an outsider makes up."""

    name: bytes
    """Eight bytes."""
    is_of_own_issuer: bool = False
    """Whether it names the issuer of its receiver; else its issuer is made up."""
    is_answer: bool = False
    """Whether it is sent as an authority's that somebody asks for; else as the signer of a BSM."""


class _Vehicle:
    """Radio link and queue of a vehicle that sends ten BSMs a second."""

    def __init__(self, keys: Credentials, utc_s: float, phase_s: float) -> None:
        self.certificate = keys.pseudonyms[0].certificate
        self.link = WaveLink(SecurityServices(utc_s, keys), psid.J2735)
        self.queue = ReceiveQueue(
            psid.LCCA, bsm_sender, self.link.known_signer, self.link.certificate_in
        )
        self.knows_other = False
        self._next_bsm_at = MEETS_S + phase_s

    def wsms_to_send(self, now: float) -> Iterator[bytes]:
        if now >= self._next_bsm_at:
            self._next_bsm_at += 0.1
            self.link.submit(b"bsm", psid.BSM, 5, 0.1, now)
        return (wsm for _, wsm in self.link.wsms_to_send(now))

    def receive_queue(self, now: float) -> None:
        unknown = islice(iter(self.queue.take_unknown, None), round(TICK_S * SERVED_HZ))
        for wsm in chain(iter(self.queue.take, None), list(unknown)):
            if self.link.receive_wsm(wsm, now) is not None:
                self.knows_other = True


def count_known(
    keys: Sequence[Credentials],
    utc_s: float,
    flood: Callable[[int], MadeUp],
    seed: tuple[int, ...],
    rate_hz: float = FLOOD_HZ,
) -> int:
    """Return how many of two vehicles know the other in time.

    Args:
        keys: of the two, whose authorities differ.
        utc_s: at the start, seconds since 1970.
        flood: gives each frame of the flood, by its number, its certificate.
        seed: of the times at which the vehicles send, and of the order of frames.
        rate_hz: frames of the flood in a second.
    """
    rng, flooded = np.random.default_rng(seed), 0
    vehicles = [_Vehicle(each, utc_s, float(rng.uniform(0.0, 0.1))) for each in keys]
    for tick in range(round((MEETS_S + LEARNS_S) / TICK_S)):
        now = tick * TICK_S
        numbers = range(flooded, math.ceil(now * rate_hz))
        flooded = numbers.stop
        for vehicle, other in (vehicles, vehicles[::-1]):
            received = [_forged(vehicle.certificate, flood(each), utc_s + now) for each in numbers]
            for wsm in other.wsms_to_send(now):
                if now >= MEETS_S:
                    received.insert(int(rng.integers(len(received) + 1)), wsm)
            for wsm in received:
                vehicle.queue.put(wsm)
        for vehicle in vehicles:
            vehicle.receive_queue(now)
    return sum(vehicle.knows_other for vehicle in vehicles)


def made_up_by(outsiders: int, number: int) -> MadeUp:
    """The certificate of a frame, as one of the outsiders makes it up.

    The first one makes up an issuer for each, the second the same 500 again and again, as vehicles
    send, the third a new certificate of the receiver's own issuer, and so on.
    """
    outsider = number % outsiders
    name = bytes((outsider,)) + (number % 500 if outsider % 3 == 1 else number).to_bytes(7)
    return MadeUp(name, is_of_own_issuer=outsider % 3 == 2)


def _forged(real: Certificate, made_up: MadeUp, utc_s: float) -> bytes:
    """A BSM under a certificate that nobody issued, and signed with nothing; or an answer."""
    if made_up.is_answer:
        certificate = real.encoded[:-8] + made_up.name
        answer = b"\x01" + choice(0) + sequence([certificate])
        return wsmp.encode(WaveShortMessage(psid.PEER_TO_PEER, answer))
    assert real.issuer_id is not None  # noqa: S101 (no pseudonym is a root)
    if made_up.is_of_own_issuer:  # and the end of the issuer's signature is made up
        signer = b"\x81\x01\x01" + real.encoded[:-8] + made_up.name
    else:
        signer = b"\x81\x01\x01" + real.encoded.replace(real.issuer_id, made_up.name)
    head = encode_to_be_signed(b"bsm", psid.BSM, to_time64(utc_s))
    signed = encode_signed(head, b"signer..", (1, 1)).replace(b"\x80signer..", signer)
    return wsmp.encode(WaveShortMessage(psid.BSM, signed))
