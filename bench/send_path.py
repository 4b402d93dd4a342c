"""The send path: encoding of BSM and footer, signing and framing; and the size of the messages.

The reference is the signature alone, as `onboard.security` makes it (deterministic, RFC 6979).
Rates are per second of processor time.
"""

import statistics
import time
from collections.abc import Callable, Iterator

import numpy as np

from bench import Figure
from bench._messages import UTC_S, bsm, footer
from onboard.messages import bsm as j2735
from onboard.messages import mvs_footer
from onboard.security import p256
from onboard.security.credentials import Credentials
from onboard.security.security_services import SecurityServices
from onboard.tools.test_ca.authority import make_trial
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage

ENTRIES = 10
MESSAGES = 500
REPEATS = 7
FOOTER_SIZES = (0, 5, 10, 20)


def measure() -> Iterator[Figure]:
    """Yield messages a second, then octets of a WSM by the entries of its footer."""
    (car,) = make_trial(
        ["car"], [psid.BSM], UTC_S, p256.key_from(np.random.default_rng(3))
    ).values()
    digest = bytes(32)
    key = car.pseudonyms[0].key

    def sign_all() -> None:
        for _ in range(MESSAGES):
            p256.sign(key, digest)

    whole, bare = [], []
    for _ in range(REPEATS):
        bare.append(MESSAGES / _time_s(sign_all))
        whole.append(MESSAGES / _time_s(lambda: send(car, ENTRIES, MESSAGES)))
    yield Figure(
        "send_path",
        statistics.median(whole),
        "messages/s",
        REPEATS,
        "bare ECDSA P-256 sign",
        statistics.median(bare),
    )
    for entries in FOOTER_SIZES:
        with_certificate, with_digest = (len(wsm) for wsm in send(car, entries, 2))
        for name, size in (("certificate", with_certificate), ("digest", with_digest)):
            yield Figure(
                f"bytes_on_air.{entries}_entries.{name}",
                size,
                "bytes",
                1,
                "unsigned, without footer",
                len(j2735.encode(bsm(0, 0, 0))),
            )


def send(car: Credentials, entries: int, count: int) -> list[bytes]:
    """Encode, sign and frame the first messages of a car.

    Args:
        car: credentials of the sender.
        entries: number of entries in each footer.
        count: number of messages, 0.1 s apart.

    Returns:
        WSMs.
    """
    security = SecurityServices(UTC_S, car)
    wsms = []
    for n in range(count):
        if entries:
            mvs_footer.encode(footer(entries))
        frame = j2735.encode(bsm(entries, 0, n))
        payload = security.secure(frame, psid.BSM, now=n * 0.1)
        wsms.append(wsmp.encode(WaveShortMessage(psid.BSM, payload)))
    return wsms


def _time_s(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start
