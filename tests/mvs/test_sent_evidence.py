"""What was sent of a track counts for it, and for the track that it is merged into."""

import gc
import weakref

import numpy as np

from onboard.mvs.evidence_to_send import EvidenceToSend
from onboard.mvs.sent_evidence import SentEvidence
from onboard.mvs.settings import MvsSettings
from onboard.tracking.track import Track
from tests.mvs.test_evidence_to_send import OTHER_ID, OWN_IDS, Observed


def two_tracks() -> list[Track]:
    observed = Observed()
    observed.receive(OTHER_ID, 1, 1000, 1000)
    observed.receive(OTHER_ID, 2, 1000, 1000)
    return observed.all


def test_a_track_keeps_its_number_on_the_air_which_no_other_has() -> None:
    tracks, sent = two_tracks(), SentEvidence()
    numbers = [sent.wire_number(track, tracks) for track in tracks]

    assert len(set(numbers)) == 2
    assert [sent.wire_number(track, tracks) for track in tracks] == numbers


def test_what_was_sent_of_a_track_is_not_sent_again_of_the_one_it_is_merged_into() -> None:
    tracks = two_tracks()
    selection = EvidenceToSend(
        MvsSettings(), np.random.default_rng(1), acceleration_density=2.0, max_measurements=16
    )
    first, second = tracks
    number = selection.sent.wire_number(second, tracks)
    piece = next(iter(second.evidence.values())).piece
    selection.sent.receive_footer([(number, piece)], tracks, 1010)

    assert [track for track, _ in selection.of_footer(tracks, 1010, OWN_IDS)] == [first]
    selection.restart()
    selection.sent.merge(first, second)
    assert selection.of_footer([first], 1020, OWN_IDS) == []


def test_nothing_is_kept_of_tracks_that_are_gone() -> None:
    sent = SentEvidence()
    track = two_tracks()[0]
    sent.wire_number(track, [track])
    gone = weakref.ref(track)
    del track
    gc.collect()
    assert gone() is None
