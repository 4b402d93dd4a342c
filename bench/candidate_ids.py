"""Communication IDs of a lead's candidates: time until they are derived, and what the loop pays.

The loop is a chain of timers a millisecond apart, with the switch interval of the daemon; the
camera hands in a frame every `FRAME_S`. The drives are rendered, and their derivations simulated,
each taking `DERIVATION_S`.
"""

import sys
import time
from collections.abc import Iterator
from statistics import median, quantiles

import numpy as np

from bench import Figure
from bench.vision_drives import CAMERA, FPS, annotated_frames, rendered_drive
from onboard.messages.lcca import MAX_NAMES
from onboard.observations import Lead, LeadIdentity, PlateCandidate
from onboard.runtime.candidate_ids import CandidateIds, next_derivation
from onboard.runtime.daemon import GIL_INTERVAL_S
from onboard.security.plate_digest import PlateDigest, normalised
from onboard.security.settings import PlateDigestSettings
from sim_rig.rendering.scene import Light

GAPS_M = (10.0, 20.0, 25.0, 30.0)
DERIVATION_S = 0.034
LEADS = 9
FRAME_S = 1 / 15
TIMER_S = 0.001
IDLE_S = 3.0
MID_EPOCH_UTC_S = 1_700_000_250.0


def measure() -> Iterator[Figure]:
    """Yield figures of rendered drives, of the thread and the loop, and of the highest cost."""
    yield from _of_drives()
    yield from _of_thread()


def _of_drives() -> Iterator[Figure]:
    """Yield how long the true text waits for its ID, and how many texts are derived in a drive."""
    rng = np.random.default_rng(5)
    waits_s, counts = [], []
    for gap_m in GAPS_M:
        for seed, light in enumerate(Light):
            shown = rendered_drive(CAMERA, light, gap_m, seed, rng)
            leads = [frame.lead for frame in annotated_frames(shown) if frame.lead is not None]
            wait_s, count = _simulated(leads, normalised(shown.text))
            waits_s += [] if wait_s is None else [wait_s]
            counts.append(count)
    every = "between two frames"
    yield Figure("candidate_ids.wait_median", median(waits_s), "s", len(waits_s), every, 1 / FPS)
    yield Figure("candidate_ids.wait_most", max(waits_s), "s", len(waits_s), every, 1 / FPS)
    yield Figure(
        "candidate_ids.derived_most", max(counts), "IDs", len(counts), "median", median(counts)
    )


def _simulated(leads: list[Lead], truth: str) -> tuple[float | None, int]:
    """Return how long the ID of the true text takes (`None`: no candidate), and IDs derived."""
    digest = PlateDigest(PlateDigestSettings(scrypt_log2_n=1))
    ids = CandidateIds(digest, "OWN1")
    texts: tuple[str, ...] = ()
    seen_s: float | None = None
    ready_s: float | None = None
    free_s, count = 0.0, 0
    for lead in leads:
        while free_s + DERIVATION_S <= lead.stamp_s and (
            due := next_derivation(digest, texts, MID_EPOCH_UTC_S)
        ):
            digest.car_id(*due)
            free_s += DERIVATION_S
            count += 1
        free_s = max(free_s, lead.stamp_s - DERIVATION_S)
        texts = ids.texts_to_derive(lead)
        if truth in map(normalised, texts):
            seen_s = lead.stamp_s if seen_s is None else seen_s
            if ready_s is None and digest.is_derived(truth, MID_EPOCH_UTC_S):
                ready_s = lead.stamp_s
    if seen_s is None:
        return None, count
    return (leads[-1].stamp_s if ready_s is None else ready_s) - seen_s, count


def _of_thread() -> Iterator[Figure]:
    """Yield the time until all candidates have IDs, the delay of the loop, and the highest cost."""
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
        while (count := len(ids.derived(_lead(number), time.time()).candidates)) < MAX_NAMES:
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
    candidates = tuple(PlateCandidate(f"L{number}T{k}", 0.05) for k in range(MAX_NAMES))
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
