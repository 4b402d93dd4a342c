"""IDs of a lead's candidates are derived beside the loop, and handed in once derived."""

import threading
import time
from collections.abc import Iterator

import pytest

from onboard.lcca.epoch_ids import ADJACENT_S, OWN_NEXT_S, EpochIds
from onboard.lcca.events import Identified, IdentityLost
from onboard.messages.lcca import MAX_NAMES
from onboard.observations import Lead, LeadIdentity, PlateCandidate
from onboard.recorder.identities import RecordingDigest
from onboard.runtime.candidate_ids import (
    EPOCH_AHEAD_S,
    LEAST_PROBABILITY,
    STEP_WITHIN_S,
    WAKE_S,
    CandidateIds,
    next_derivation,
)
from onboard.security.plate_digest import PlateDigest, normalised
from onboard.security.settings import PlateDigestSettings

CHEAP = PlateDigestSettings(scrypt_log2_n=1)
EPOCH_BEGIN_S = 1_700_000_100.0
MIDDLE_S = EPOCH_BEGIN_S + 100.0
EPOCH_END_S = EPOCH_BEGIN_S + CHEAP.epoch_s
OWN = "OWN1"
TEXTS = ("AB123", "AB128", "A8123")


def lead(*texts: str, text: str | None = None, track_id: int = 1) -> Lead:
    candidates = tuple(PlateCandidate(each, 0.9 / len(texts)) for each in texts)
    identity = LeadIdentity.UNKNOWN if text is None else LeadIdentity.KNOWN
    return Lead(1.0, identity, text, 20.0, track_id=track_id, candidates=candidates)


def texts_of(observed: Lead) -> tuple[str, ...]:
    return tuple(each.text for each in observed.candidates)


def derivations(digest: PlateDigest, utc_s: float) -> Iterator[tuple[str, int]]:
    """Derive all that is due at `utc_s`; yield texts and epochs in this order."""
    while (due := next_derivation(digest, (OWN, *TEXTS), utc_s)) is not None:
        digest.car_id(*due)
        yield due[0], digest.epoch(due[1])


def test_the_likeliest_text_of_the_present_epoch_is_derived_first() -> None:
    digest = PlateDigest(CHEAP)
    present = digest.epoch(MIDDLE_S)

    in_the_middle = list(derivations(digest, MIDDLE_S))
    before_the_end = list(derivations(digest, EPOCH_END_S - EPOCH_AHEAD_S))

    assert in_the_middle == [(text, present) for text in (OWN, *TEXTS)]
    assert before_the_end == [(text, present + 1) for text in (OWN, *TEXTS)]


def test_a_lead_met_at_the_start_of_an_epoch_is_handed_in_with_its_previous_id() -> None:
    """The step needs that, too, and derived it itself: 47 ms in which no warning was sent."""
    digest, utc_s = PlateDigest(CHEAP), EPOCH_BEGIN_S + 1.0
    ids = CandidateIds(digest, OWN)
    digest.car_id("AB123", utc_s)
    assert texts_of(ids.derived(lead("AB123"), utc_s)) == ()

    while (due := next_derivation(digest, ids.texts_to_derive(lead("AB123")), utc_s)) is not None:
        digest.car_id(*due)

    assert texts_of(ids.derived(lead("AB123"), utc_s)) == ("AB123",)
    assert digest.is_derived("AB123", EPOCH_BEGIN_S - 1.0)


def test_what_is_handed_in_lets_a_step_derive_nothing() -> None:
    for since_s in (0.0, 0.5 * ADJACENT_S, 0.5 * CHEAP.epoch_s):
        digest, utc_s = PlateDigest(CHEAP), EPOCH_BEGIN_S + since_s
        CandidateIds(digest, OWN).derived(lead("AB123", text="AB123"), utc_s)
        derived_before = digest.is_derived("AB123", utc_s - ADJACENT_S)

        ids = EpochIds(digest, OWN).of("AB123", utc_s)

        assert derived_before
        assert (ids.previous is not None) is (since_s < ADJACENT_S)


def test_a_lead_met_before_the_end_of_an_epoch_is_first_derived_for_the_present_one() -> None:
    digest = PlateDigest(CHEAP)
    present = digest.epoch(EPOCH_BEGIN_S)

    done = list(derivations(digest, EPOCH_END_S - 2.0))

    assert [epoch for _, epoch in done] == [present] * 4 + [present + 1] * 4


def test_a_lead_is_handed_in_with_the_candidates_that_are_derived() -> None:
    digest = PlateDigest(CHEAP)
    ids = CandidateIds(digest, OWN)
    seen = lead(*TEXTS)
    assert texts_of(ids.derived(seen, MIDDLE_S)) == ()

    digest.car_id("AB128", MIDDLE_S)

    (candidate,) = ids.derived(seen, MIDDLE_S).candidates
    assert candidate == seen.candidates[1]
    assert texts_of(ids.derived(seen, EPOCH_END_S)) == ()


def test_shortly_before_an_epoch_ends_a_candidate_needs_both_ids() -> None:
    """The step that receives the lead may come after the change."""
    digest = PlateDigest(CHEAP)
    ids = CandidateIds(digest, OWN)
    digest.car_id("AB123", EPOCH_BEGIN_S)
    just_before_s = EPOCH_END_S - STEP_WITHIN_S / 2
    assert texts_of(ids.derived(lead("AB123"), just_before_s)) == ()

    digest.car_id("AB123", EPOCH_END_S)

    assert texts_of(ids.derived(lead("AB123"), just_before_s)) == ("AB123",)


@pytest.mark.parametrize("utc_s", [EPOCH_BEGIN_S, EPOCH_END_S - STEP_WITHIN_S / 2])
def test_the_voted_text_is_handed_in_at_once(utc_s: float) -> None:
    digest = PlateDigest(CHEAP)

    observed = CandidateIds(digest, OWN).derived(lead(*TEXTS, text="AB123"), utc_s)

    assert (observed.text, texts_of(observed)) == ("AB123", ("AB123",))
    assert digest.is_derived("AB123", utc_s + STEP_WITHIN_S)


def test_a_lead_without_candidates_passes_unchanged() -> None:
    ids = CandidateIds(PlateDigest(CHEAP), OWN)
    none = Lead(1.0, LeadIdentity.NO_LEAD)

    assert ids.derived(none, EPOCH_BEGIN_S) == none
    assert ids.derived(lead(), EPOCH_BEGIN_S) == lead()


def test_more_candidates_than_a_lead_has_are_left_out() -> None:
    digest = PlateDigest(CHEAP)
    many = [f"AB{number}" for number in range(MAX_NAMES + 1)]
    for text in many:
        digest.car_id(text, MIDDLE_S)

    assert texts_of(CandidateIds(digest, OWN).derived(lead(*many), MIDDLE_S)) == tuple(
        many[:MAX_NAMES]
    )


def test_a_text_that_will_not_be_asked_for_is_not_derived() -> None:
    probabilities = {"AB123": 0.99, "AB128": LEAST_PROBABILITY, "A8123": 0.9 * LEAST_PROBABILITY}
    candidates = tuple(PlateCandidate(*each) for each in probabilities.items())
    seen = Lead(1.0, LeadIdentity.UNKNOWN, None, 20.0, track_id=1, candidates=candidates)

    ids = CandidateIds(PlateDigest(CHEAP), OWN)

    assert ids.texts_to_derive(seen) == ("AB123", "AB128")


# ---- the thread, with the derivation of the default cost ----------------------------------


class Running:
    """The thread, and what it derives."""

    def __init__(self) -> None:
        self.derived: list[str] = []
        self.threads: set[str] = set()
        self.digest = RecordingDigest(PlateDigestSettings(), self._on_derived)
        self.ids = CandidateIds(self.digest, OWN)

    def _on_derived(self, plate: str, _epoch: int, _car_id: bytes) -> None:
        self.derived.append(plate)
        self.threads.add(threading.current_thread().name)

    def until_all_derived(self, seen: Lead) -> None:
        """Hand in frames of a lead until all its candidates have IDs."""
        end_s = time.monotonic() + 20.0
        while self.ids.derived(seen, time.time()) != seen:
            assert time.monotonic() < end_s
            time.sleep(0.02)


@pytest.fixture
def running() -> Iterator[Running]:
    it = Running()
    it.ids.start()
    yield it
    it.ids.close()


@pytest.mark.long
def test_candidates_are_derived_in_a_thread_the_likeliest_first(running: Running) -> None:
    texts = [f"XY{number}" for number in range(2, 2 + MAX_NAMES)]

    running.until_all_derived(lead(*texts))

    order = list(dict.fromkeys(running.derived))
    assert order == [normalised(text) for text in (OWN, *texts)]
    assert running.threads == {"candidate-ids"}


def test_of_an_identified_track_only_the_text_of_its_car_is_derived(running: Running) -> None:
    car_id = bytes(8)
    running.ids.receive_identity(Identified(1.0, 1, car_id, "KEPT5", 0.9995, "answer"))
    running.ids.derived(lead(*TEXTS, track_id=1), time.time())
    running.until_all_derived(lead("AFTER2", track_id=2))
    of_identified = set(running.derived)

    running.ids.receive_identity(IdentityLost(2.0, 1, car_id, "refuted"))
    running.until_all_derived(lead(*TEXTS, track_id=1))

    assert not of_identified & set(TEXTS)


@pytest.mark.parametrize("text", ["KEPT5", None])
def test_the_next_id_of_the_identified_car_is_derived_ahead(text: str | None) -> None:
    """Its text may cease to be a candidate; without one, candidates are derived as before."""
    ids = CandidateIds(PlateDigest(CHEAP), OWN)
    ids.receive_identity(Identified(1.0, 1, bytes(8), text, 0.9995, "answer"))

    assert ids.texts_to_derive(lead(*TEXTS)) == ((text,) if text else TEXTS)


def test_a_new_lead_comes_before_the_rest_of_the_one_before(running: Running) -> None:
    before = [f"XY{number}" for number in range(2, 2 + MAX_NAMES)]
    running.ids.derived(lead(*before), time.time())

    running.until_all_derived(lead(*TEXTS, track_id=2))

    assert not set(before) <= set(running.derived)


def test_the_own_next_id_is_due_before_a_step_needs_it() -> None:
    latest_look_s = EPOCH_END_S - OWN_NEXT_S - WAKE_S
    digest = PlateDigest(PlateDigestSettings(scrypt_log2_n=1))
    digest.car_id("OWN1", latest_look_s)

    due = next_derivation(digest, ("OWN1",), latest_look_s)

    assert due is not None
    assert digest.epoch(due[1]) == digest.epoch(EPOCH_END_S)
