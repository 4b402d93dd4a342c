"""The receive path: decoding of WSM, 1609.2 verification, decoding of BSM and footer.

Twenty cars send at 10 Hz. Each attaches its certificate now and then and otherwise sends the
digest, so certificates are known after the first message; `.implicit` is the same with implicit
certificates. `.new` counts certificates that the receiver does not know yet, without messages.

The reference is the signature alone: OpenSSL's ECDSA P-256 through the same library, of digests,
with keys loaded. Rates are per second of processor time.
"""

import statistics
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import Prehashed

from bench import Figure
from bench._messages import UTC_S, bsm
from onboard.messages import bsm as j2735
from onboard.messages import mvs_footer
from onboard.security import p256
from onboard.security.credentials import Credentials
from onboard.security.security_services import SecurityServices
from onboard.security.trust import TrustStore
from onboard.tools.test_ca.authority import make_trial
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage

CARS = 20
ENTRIES = 10
ROUNDS = 50
"""Number of BSMs of each car, 0.1 s apart."""
PSEUDONYMS = 10
"""Number of certificates of each car."""
REPEATS = 7


def measure() -> Iterator[Figure]:
    """Yield rates of messages, of messages without verification, and of new certificates."""
    explicit, implicit = _trial(implicit=False), _trial(implicit=True)
    wsms, implicit_wsms = (signed_wsms(trial[:-1], ENTRIES) for trial in (explicit, implicit))
    receiver = explicit[-1]
    rates: dict[str, list[float]] = defaultdict(list)
    bare = []
    for _ in range(REPEATS):
        bare.append(_verify_rate_hz())
        for name, given in (("", wsms), (".implicit", implicit_wsms)):
            rates[name].append(len(given) / _time_s(partial(receive_all, receiver, given)))
        rates[".unverified"].append(len(wsms) / _time_s(lambda: _decode_all(wsms)))
        for name, trial in ((".explicit", explicit), (".implicit", implicit)):
            seconds = _time_s(partial(_receive_certificates, receiver, trial))
            rates[f".new{name}"].append(CARS * PSEUDONYMS / seconds)
    reference, verify = "bare ECDSA P-256 verify", statistics.median(bare)
    for name, measured in rates.items():
        unit = "certificates/s" if name.startswith(".new") else "messages/s"
        value = statistics.median(measured)
        yield Figure(f"receive_path{name}", value, unit, REPEATS, reference, verify)


def _trial(*, implicit: bool) -> list[Credentials]:
    """Credentials of the cars and of the receiver; the authority is the same for the same seed."""
    return list(
        make_trial(
            [f"car{n}" for n in range(CARS + 1)],
            [psid.BSM],
            UTC_S,
            p256.key_from(np.random.default_rng(3)),
            pseudonyms=PSEUDONYMS,
            implicit=implicit,
        ).values()
    )


def _receive_certificates(receiver: Credentials, cars: Sequence[Credentials]) -> None:
    """Verify the chain of each certificate, or reconstruct its key, with a new receiver."""
    trust = TrustStore(receiver.roots, receiver.authorities)
    for car in cars[:CARS]:
        for own in car.pseudonyms:
            trust.receive_certificate(own.certificate)


def signed_wsms(cars: Sequence[Credentials], entries: int) -> list[tuple[float, bytes]]:
    """WSMs of all cars with their times."""
    senders = [SecurityServices(UTC_S, credentials) for credentials in cars]
    wsms = []
    for count in range(ROUNDS):
        for car, sender in enumerate(senders):
            now = count * 0.1 + car * 0.1 / len(cars)
            payload = sender.secure(j2735.encode(bsm(entries, car, count)), psid.BSM, now)
            wsms.append((now, wsmp.encode(WaveShortMessage(psid.BSM, payload))))
    return wsms


def receive_all(receiver: Credentials, wsms: list[tuple[float, bytes]]) -> None:
    """Receive all messages with a new receiver."""
    security = SecurityServices(UTC_S, receiver)
    for now, data in wsms:
        wsm = wsmp.decode(data)
        opened = security.open(wsm.payload, wsm.psid, now)
        _decode(opened.payload)


def _decode_all(wsms: list[tuple[float, bytes]]) -> None:
    """Receive without credentials, so without verification."""
    security = SecurityServices(UTC_S)
    for now, data in wsms:
        wsm = wsmp.decode(data)
        _decode(security.open(wsm.payload, wsm.psid, now).payload)


def _decode(frame: bytes) -> None:
    footer = j2735.decode(frame).footer
    if footer is None:
        raise RuntimeError("the footer was lost")
    mvs_footer.decode(footer)


def _verify_rate_hz() -> float:
    key = p256.new_key()
    digests = [n.to_bytes(32) for n in range(1000)]
    algorithm = ec.ECDSA(Prehashed(hashes.SHA256()))
    signed = [(key.sign(digest, algorithm), digest) for digest in digests]
    public_key = key.public_key()

    def verify() -> None:
        for signature, digest in signed:
            public_key.verify(signature, digest, algorithm)

    return len(signed) / _time_s(verify)


def _time_s(work: Callable[[], None]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start
