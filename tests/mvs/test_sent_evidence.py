"""What was sent of a track counts for it, and for the track that it is merged into."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from typing_extensions import override

from onboard.mvs.evidence_to_send import EvidenceToSend
from onboard.mvs.footer_reading import read
from onboard.mvs.sent_evidence import SentEvidence
from onboard.mvs.settings import MvsSettings
from onboard.observations import VehicleDetection
from onboard.tracking.evidence import MeasurementId
from onboard.tracking.slices import result_of
from onboard.tracking.track import Track
from tests.mvs.test_evidence_to_send import OTHER_ID, OWN_IDS, Observed
from tests.mvs.world import Car, World


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
    selection.sent.receive_sent([(number, piece)], tracks, 1010)

    assert [track for track, _ in result_of(selection.of_footer(tracks, 1010, OWN_IDS))] == [first]
    selection.restart()
    selection.sent.merge(first, second)
    assert result_of(selection.of_footer([first], 1020, OWN_IDS)) == []


class WrongAtFirst(World):
    """Two cars measure x, one of them 7 m too far away in the first second; a sees nothing."""

    @override
    def seen(self, car: Car, state: np.ndarray, other: Car, number: int) -> VehicleDetection:
        right = super().seen(car, state, other, number)
        is_wrong = car.name == "d" and self.t < self.start + 1.0
        return replace(right, range_m=right.range_m + 7.0) if is_wrong else right


@pytest.mark.parametrize(
    "seed", [1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3))]
)
def test_a_vehicle_whose_tracks_were_merged_sends_nothing_again(seed: int) -> None:
    """Others forward both measurements of x together once they have one track of it."""
    sight = frozenset({"x"})
    world = WrongAtFirst(
        [
            Car("a", -60.0, 0.0, heading_rad=0.0),
            Car("c", 40.0, 0.0, sees=sight, heading_rad=0.0),
            Car("d", 0.0, 40.0, sees=sight, heading_rad=0.0),
            Car("x", 0.0, 0.0, radio=False),
        ],
        seed=seed,
    )
    world.run(3.0)

    footers = [read(each.footer) for each in world.sent if each.sender.name == "a" and each.footer]
    assert max(map(len, footers)) == 2
    assert len(footers[-1]) == 1
    sent: set[MeasurementId] = set()
    for provenance in (each for footer in footers for each in footer.provenances):
        assert not provenance <= sent
        sent |= provenance


def test_nothing_is_kept_of_tracks_that_are_gone() -> None:
    sent = SentEvidence()
    track = two_tracks()[0]
    sent.wire_number(track, [track])
    gone = weakref.ref(track)
    del track
    gc.collect()
    assert gone() is None
