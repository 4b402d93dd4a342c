"""The receive path: decoding of WSM, 1609.2 verification, decoding of BSM and footer.

Twenty cars send at 10 Hz. Each attaches its certificate now and then and otherwise sends the
digest, so certificates are known after the first message. The reference is the signature alone:
OpenSSL's ECDSA P-256 through the same library, of digests, with keys loaded. Rates are per second
of processor time.
"""

import statistics
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import Prehashed

from bench import Figure
from bench._messages import UTC_S, bsm
from onboard import psid
from onboard.messages import bsm as j2735
from onboard.messages import mvs_footer
from onboard.security import p256
from onboard.security.credentials import Credentials
from onboard.security.security_services import SecurityServices
from onboard.tools.test_ca.authority import make_trial
from onboard.wave_udp import wsmp
from onboard.wave_udp.wsmp import WaveShortMessage

CARS = 20
ENTRIES = 10
ROUNDS = 50
"""Number of BSMs of each car, 0.1 s apart."""
REPEATS = 7


def measure() -> Iterator[Figure]:
    """Yield messages a second through the whole path, and without verification."""
    credentials = make_trial(
        [f"car{n}" for n in range(CARS + 1)],
        [psid.BSM],
        UTC_S,
        p256.key_from(np.random.default_rng(3)),
    )
    *cars, receiver = credentials.values()
    wsms = signed_wsms(cars, ENTRIES)
    reference = "bare ECDSA P-256 verify"
    whole, parts, bare = [], [], []
    for _ in range(REPEATS):
        bare.append(_verify_rate_hz())
        whole.append(len(wsms) / _time_s(lambda: receive_all(receiver, wsms)))
        parts.append(len(wsms) / _time_s(lambda: _decode_all(wsms)))
    verify = statistics.median(bare)
    yield Figure("receive_path", statistics.median(whole), "messages/s", REPEATS, reference, verify)
    yield Figure(
        "receive_path.unverified",
        statistics.median(parts),
        "messages/s",
        REPEATS,
        reference,
        verify,
    )


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
