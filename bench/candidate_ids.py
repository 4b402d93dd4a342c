"""Communication IDs of a lead's candidates: time until they are derived, and what the loop pays.

The loop is a chain of timers a millisecond apart, with the switch interval of the daemon; the
camera hands in a frame every `FRAME_S`.
"""

import sys
import time
from collections.abc import Iterator
from statistics import median, quantiles

from bench import Figure
from onboard.daemon import GIL_INTERVAL_S
from onboard.observations import Lead, LeadIdentity, PlateCandidate
from onboard.runtime.candidate_ids import MOST_CANDIDATES, CandidateIds
from onboard.security.plate_digest import PlateDigest
from onboard.security.settings import PlateDigestSettings

LEADS = 9
FRAME_S = 1 / 15
TIMER_S = 0.001
IDLE_S = 3.0


def measure() -> Iterator[Figure]:
    """Yield the time until candidates have IDs, the delay of the loop, and the highest cost."""
    sys.setswitchinterval(GIL_INTERVAL_S)
    digest = PlateDigest(PlateDigestSettings())
    one_s = median(_derivation_s(digest, f"ONE{number}") for number in range(LEADS))
    idle_s = _delays_s(time.monotonic() + IDLE_S)
    ids = CandidateIds(digest, "OWN1")
    ids.start()
    first_s, all_s, delays_s = [], [], []
    for number in range(LEADS):
        began_s = time.monotonic()
        after_s = [0.0]
        while (count := len(ids.derived(_lead(number), time.time()).candidates)) < MOST_CANDIDATES:
            after_s += [time.monotonic() - began_s] * (count > 0)
            delays_s += _delays_s(time.monotonic() + FRAME_S)
        first_s.append(min(after_s[1:], default=0.0))
        all_s.append(time.monotonic() - began_s)
    ids.close()
    one = "one derivation"
    yield Figure("candidate_ids.likeliest", median(first_s), "s", LEADS, one, one_s)
    yield Figure("candidate_ids.all_16", median(all_s), "s", LEADS, one, one_s)
    yield Figure(
        "candidate_ids.loop_delay_p99",
        _percentile_99(delays_s),
        "s",
        len(delays_s),
        "without derivations",
        _percentile_99(idle_s),
    )
    highest = PlateDigest(PlateDigestSettings(scrypt_log2_n=20))
    highest_s = _derivation_s(highest, "ONE1")
    yield Figure("candidate_ids.highest_cost", highest_s, "s", 1, one, one_s)


def _lead(number: int) -> Lead:
    candidates = tuple(PlateCandidate(f"L{number}T{k}", 0.05) for k in range(MOST_CANDIDATES))
    return Lead(0.0, LeadIdentity.UNKNOWN, None, 20.0, track_id=number, candidates=candidates)


def _derivation_s(digest: PlateDigest, text: str) -> float:
    began_s = time.monotonic()
    digest.car_id(text, time.time())
    return time.monotonic() - began_s


def _delays_s(until_s: float) -> list[float]:
    """Return how late each timer of the loop is, up to a time."""
    delays_s = []
    while (at_s := time.monotonic() + TIMER_S) < until_s:
        time.sleep(TIMER_S)
        delays_s.append(time.monotonic() - at_s)
    return delays_s


def _percentile_99(values: list[float]) -> float:
    return quantiles(values, n=100)[-1]
