"""Which track evidence goes to: by its sender's number first, by position where that is certain."""

import numpy as np
import pytest

from onboard.mvs.tracked_objects import as_tracked_objects, without_radio
from onboard.tracking.evidence import (
    Estimate,
    Evidence,
    Measurement,
    ProvenanceSpans,
    as_arrays,
    measurement_id,
    observer_of,
)
from onboard.tracking.evidence_store import OWN, EvidenceBatch
from onboard.tracking.perceived_object import PerceivedObject
from onboard.tracking.tracks import TrackingParameters, Tracks

A, B = b"aaaa", b"bbbb"


def measured(x_m: float, y_m: float, stamp_ms: int, sigma_m: float, by: bytes = A) -> Measurement:
    identity = measurement_id(by, stamp_ms)
    return Measurement(identity, np.array([x_m, y_m]), np.eye(2) * sigma_m**2)


def estimated(x_m: float, y_m: float, *stamps_ms: int, by: bytes = A, sigma_m: float) -> Estimate:
    provenance = frozenset(measurement_id(by, stamp_ms) for stamp_ms in stamps_ms)
    covariance = np.diag([sigma_m**2, sigma_m**2, 1.0, 1.0])
    return Estimate(provenance, np.array([x_m, y_m, 0.0, 0.0]), covariance)


def receive(tracks: Tracks, sender: bytes, cars: dict[int, Evidence], now_ms: int) -> list[int]:
    """Let `tracks` receive what a sender reports under its numbers; return the rows refused."""
    pieces = list(cars.values())
    provenances = [piece.provenance for piece in pieces]
    refused = tracks.receive_evidence(
        EvidenceBatch(
            [sender] * len(pieces),
            list(cars),
            provenances,
            [now_ms] * len(pieces),
            ProvenanceSpans.of(provenances),
            [isinstance(piece, Measurement) for piece in pieces],
            as_arrays(pieces),
        )
    )
    tracks.update(now_ms)
    return refused


def test_evidence_under_a_known_number_stays_on_its_track_however_uncertain_it_is() -> None:
    tracks = Tracks()
    for k in range(4):
        receive(tracks, A, {7: measured(0, 0, 1000 + 100 * k, 1.4)}, 1050 + 100 * k)

    (track,) = tracks
    assert track.is_reported
    assert len(track.used) == 4


def test_the_first_vague_measurement_of_a_car_does_not_go_to_its_neighbour() -> None:
    """A car on the next lane, 3.5 m away, that nobody has reported before."""
    tracks = Tracks()
    for k in range(5):
        receive(tracks, A, {7: estimated(0, 0, 1000 + 100 * k, sigma_m=0.3)}, 1050 + 100 * k)

    receive(tracks, B, {1: measured(0, 2.5, 1460, 1.4, by=B)}, 1470)

    assert [len(track.used) for track in tracks] == [5, 1]
    assert [track.is_reported for track in tracks] == [True, False]


def test_a_new_number_for_a_well_known_place_is_that_car() -> None:
    tracks = Tracks()
    for k in range(3):
        receive(tracks, A, {7: estimated(0, 0, 1000 + 100 * k, sigma_m=0.3)}, 1050 + 100 * k)

    receive(tracks, B, {1: estimated(0.4, 0.3, 1260, by=B, sigma_m=0.3)}, 1270)

    (track,) = tracks
    assert set(track.labels) == {(A, 7), (B, 1)}


def test_who_shares_a_measurement_and_a_place_is_one_car_however_vague() -> None:
    tracks = Tracks()
    receive(tracks, A, {7: measured(0, 0, 1000, 1.4)}, 1050)

    receive(tracks, B, {1: estimated(0.3, 0.2, 1000, 900, sigma_m=1.2)}, 1060)

    (track,) = tracks
    assert set(track.labels) == {(A, 7), (B, 1)}


def test_a_number_that_jumps_to_another_car_is_another_car() -> None:
    tracks = Tracks()
    for k in range(4):
        receive(tracks, OWN, {7: measured(0, 0, 1000 + 100 * k, 0.3)}, 1050 + 100 * k)

    receive(tracks, OWN, {7: measured(20, 0, 1400, 0.3)}, 1450)

    first, second = tracks
    assert first.labels == {}
    assert set(second.labels) == {(OWN, 7)}


def test_two_numbers_of_one_vehicle_are_merged() -> None:
    """Two senders measure it from afar; it is never reported as two vehicles."""
    rng = np.random.default_rng(0)
    tracks, merged = Tracks(), []
    for k in range(12):
        for at, sender in enumerate((A, B)):
            stamp_ms = 1000 + 100 * k + 30 * at
            x_m, y_m = rng.normal(0, 1.0, 2)
            seen = measured(x_m, y_m, stamp_ms, 1.0, by=sender)
            receive(tracks, sender, {5: seen}, stamp_ms + 10)
            merged += tracks.merged
            assert sum(track.is_reported for track in tracks) <= 1

    (track,) = tracks
    assert [kept for kept, _ in merged] == [track]
    assert {observer_of(each) for each in track.estimate.provenance} == {A, B}


def test_two_vehicles_of_one_image_are_never_merged() -> None:
    tracks = Tracks()
    for k in range(12):
        stamp_ms = 1000 + 100 * k
        seen: dict[int, Evidence] = {
            1: measured(0, 0, stamp_ms, 0.8),
            2: measured(0, 1.2, stamp_ms, 0.8),
        }
        receive(tracks, OWN, seen, stamp_ms + 10)

    assert len(tracks) == 2
    assert all(track.is_reported for track in tracks)


def test_what_others_report_does_not_hide_what_own_sensors_measure() -> None:
    tracks = Tracks()
    for k in range(4):
        now_ms = 1000 + 100 * k
        receive(tracks, OWN, {1: measured(0, 0, now_ms, 0.8)}, now_ms)
        receive(tracks, B, {1: estimated(2, 0, now_ms, by=B, sigma_m=0.5)}, now_ms)

    sensed, reported = tracks
    assert np.trace(reported.estimate.covariance[:2, :2]) < np.trace(
        sensed.estimate.covariance[:2, :2]
    )
    assert (sensed.is_reported, reported.is_reported) == (True, False)


def test_a_duplicate_that_is_not_reported_hides_no_other_track() -> None:
    """Each is a duplicate of the one before and less certain; the last is none of the first."""
    tracks = Tracks()
    for k in range(4):
        now_ms = 1000 + 100 * k
        for at in range(3):
            sender = bytes([at + 1]) * 4
            evidence = estimated(2.1 * at, 0, now_ms, by=sender, sigma_m=0.7 + 0.1 * at)
            receive(tracks, sender, {1: evidence}, now_ms)

    assert [track.is_reported for track in tracks] == [True, False, True]


def reported_by(tracks: Tracks) -> list[PerceivedObject]:
    reported = without_radio(tracks)
    return as_tracked_objects(1.3, 1300, reported, [each.placed for each in reported], 2.0)


def placed_by(*seen: tuple[bytes, float, float]) -> PerceivedObject:
    """What is reported of one vehicle that each sender places elsewhere, by x and sigma in m."""
    tracks = Tracks()
    for k in range(4):
        now_ms = 1000 + 100 * k
        for sender, x_m, sigma_m in seen:
            evidence = estimated(x_m, 0, now_ms, by=sender or A, sigma_m=sigma_m)
            receive(tracks, sender, {1: evidence}, now_ms)
    (reported,) = reported_by(tracks)
    return reported


def test_a_vehicle_that_two_observers_place_differently_is_reported_between_both() -> None:
    reported = placed_by((A, 0.0, 0.7), (B, 2.0, 0.7))

    assert reported.state[0] == pytest.approx(1.0, abs=0.1)
    assert reported.reporters == {A, B}
    assert {observer_of(each) for each in reported.provenance} == {A, B}


def test_a_track_too_uncertain_to_be_reported_separates_no_duplicates() -> None:
    """It may be the one that A places, and is too far from the one that B places."""
    reported = placed_by((A, 0.0, 0.7), (B, 2.0, 0.7), (b"cccc", -6.5, 10.0))

    assert reported.state[0] == pytest.approx(1.0, abs=0.1)
    assert {observer_of(each) for each in reported.provenance} == {A, B}


def test_what_others_report_does_not_move_what_own_sensors_measure() -> None:
    assert placed_by((OWN, 0.0, 0.8), (B, 2.0, 0.5)).state[0] == 0.0


def test_a_track_that_may_be_either_of_two_vehicles_moves_neither() -> None:
    """A sees two vehicles side by side, B one of them."""
    tracks = Tracks()
    for k in range(4):
        now_ms = 1000 + 100 * k
        seen = {at: estimated(0, 4.0 * at, now_ms, sigma_m=0.5) for at in range(2)}
        receive(tracks, A, dict(seen), now_ms)
        receive(tracks, B, {1: estimated(0, 2.0, now_ms, by=B, sigma_m=0.9)}, now_ms)

    reported = reported_by(tracks)
    assert [each.state[1] for each in reported] == [0.0, 4.0]


def test_evidence_that_repeats_used_measurements_is_not_used() -> None:
    tracks = Tracks()
    for k in range(8):
        receive(tracks, A, {7: measured(0, 0, 1000 + 100 * k, 0.5)}, 1050 + 100 * k)

    receive(tracks, B, {1: estimated(0, 0, 1000, 1100, 1700, sigma_m=0.3)}, 1760)

    (track,) = tracks
    used = [identity for piece in track.used for identity in piece.provenance]
    assert len(used) == len(set(used)) == 8
    assert all(isinstance(piece, Measurement) for piece in track.used)


def test_a_track_is_dropped_with_the_last_of_its_evidence() -> None:
    """An estimate with an old measurement is dropped before the car counts as unseen."""
    tracks = Tracks()
    receive(tracks, A, {7: estimated(0, 0, 1100, 3000, sigma_m=0.5)}, 3000)
    assert len(tracks) == 1

    tracks.update(3150)

    assert len(tracks) == 0


def test_a_track_whose_evidence_expires_is_dropped_before_it_counts_as_unseen() -> None:
    tracks = Tracks(TrackingParameters(unseen_s=3.0, memory_s=2.0))
    for k in range(4):
        receive(tracks, OWN, {7: measured(0, 0, 1000 + 100 * k, 0.5)}, 1000 + 100 * k)

    tracks.update(3400)

    assert len(tracks) == 0


def test_rows_of_evidence_that_no_track_has_are_dropped() -> None:
    """The rows that stay keep their values, wherever they are moved to."""
    tracks = Tracks()
    for k in range(60):
        now_ms = 1000 + 100 * k
        evidence: dict[int, Evidence] = {n: measured(50 * n, k, now_ms - n, 1.0) for n in range(30)}
        receive(tracks, OWN, evidence, now_ms)

    assert len(tracks) == 30
    held = [each for track in tracks for each in track.stored]
    assert max(each.row for each in held) < 2 * len(held) + 30
    for track in tracks:
        for piece in track.pieces:
            assert isinstance(piece, Measurement)
            tick, n = divmod(piece.stamp_ms - 1000 + track.number - 1, 100)
            assert n == 0
            assert piece.position_m.tolist() == [50.0 * (track.number - 1), tick]
