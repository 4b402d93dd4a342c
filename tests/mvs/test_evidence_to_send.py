"""Which evidence of a track is broadcast, and how often."""

import numpy as np
import pytest

from onboard.mvs.evidence_to_send import SHARED_SPAN_S, EvidenceToSend
from onboard.mvs.settings import MvsSettings
from onboard.tracking.evidence import Measurement, ProvenanceSpans, as_arrays, measurement_id
from onboard.tracking.evidence_store import OWN, EvidenceBatch
from onboard.tracking.slices import result_of
from onboard.tracking.track import Track
from onboard.tracking.tracks import Tracks

OWN_ID, OTHER_ID = b"-own", b"aaaa"
OWN_IDS = (OWN_ID,)


def to_send(**changes: object) -> EvidenceToSend:
    return EvidenceToSend(
        MvsSettings.model_validate(changes),
        np.random.default_rng(1),
        acceleration_density=2.0,
        max_measurements=16,
    )


class Observed:
    """Tracks of two vehicles, 50 m apart, that own sensors measure under the numbers 1 and 2."""

    def __init__(self) -> None:
        self.tracks = Tracks()

    def receive(self, sender: bytes, number: int, stamp_ms: int, now_ms: int) -> None:
        observer = OWN_ID if sender == OWN else sender
        identity = measurement_id(observer, stamp_ms)
        piece = Measurement(identity, np.array([50.0 * number, 0.0]), 0.01 * np.eye(2))
        self.tracks.receive_evidence(
            EvidenceBatch(
                [sender],
                [number],
                [piece.provenance],
                [now_ms],
                ProvenanceSpans.of([piece.provenance]),
                [True],
                as_arrays([piece]),
            )
        )
        self.tracks.update(now_ms)

    @property
    def all(self) -> list[Track]:
        return list(self.tracks)


@pytest.fixture
def observed() -> Observed:
    """Both vehicles, measured once, at 1.0 s."""
    both = Observed()
    for number in (1, 2):
        both.receive(OWN, number, 1000, 1000)
    return both


def test_a_piece_of_evidence_is_selected_in_one_window_only(observed: Observed) -> None:
    selection = to_send()
    first = result_of(selection.of_footer(observed.all, 1010, OWN_IDS))
    observed.receive(OWN, 2, 1100, 1100)

    assert [track.number for track, _ in first] == [1, 2]
    second = result_of(selection.of_footer(observed.all, 1110, OWN_IDS))
    assert [track.number for track, _ in second] == [2]
    assert result_of(selection.of_footer(observed.all, 1210, OWN_IDS)) == []


def test_evidence_older_than_what_may_be_shared_is_not_sent(observed: Observed) -> None:
    late_ms = 1001 + round(SHARED_SPAN_S * 1000)

    assert result_of(to_send().of_footer(observed.all, late_ms, OWN_IDS)) == []
    assert to_send().of_sdsm(observed.all, late_ms, OWN_IDS) == []


def test_an_sdsm_has_each_own_measurement_once_and_those_of_nobody_else(
    observed: Observed,
) -> None:
    selection = to_send()
    first = selection.of_sdsm(observed.all, 1010, OWN_IDS)
    observed.receive(OTHER_ID, 1, 1050, 1060)
    observed.receive(OWN, 2, 1100, 1100)
    second = selection.of_sdsm(observed.all, 1110, OWN_IDS)

    assert [piece.stamp_ms for _, piece in first] == [1000, 1000]
    assert [(track.number, piece.stamp_ms) for track, piece in second] == [(2, 1100)]


def test_with_few_entries_those_sent_the_longest_ago_come_first(observed: Observed) -> None:
    selection = to_send(max_entries=1)
    numbers = []
    for stamp_ms in (1000, 1100, 1200):
        for number in (1, 2):
            observed.receive(OWN, number, stamp_ms, stamp_ms)
        numbers += [t.number for t, _ in selection.of_sdsm(observed.all, stamp_ms + 10, OWN_IDS)]

    assert numbers == [1, 2, 1]


def test_after_a_correction_of_utc_earlier_evidence_may_be_sent(observed: Observed) -> None:
    selection = to_send()
    result_of(selection.of_footer([], 9000, OWN_IDS))

    assert result_of(selection.of_footer(observed.all, 1010, OWN_IDS)) == []
    selection.restart()
    assert len(result_of(selection.of_footer(observed.all, 1020, OWN_IDS))) == 2
