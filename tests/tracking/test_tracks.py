"""Whose evidence is whose: by the teller's number first, by place only where that is certain."""

import numpy as np

from onboard.tracking.evidence import (
    Estimate,
    Evidence,
    Measurement,
    MeasurementId,
    ProvenanceSpans,
    as_arrays,
)
from onboard.tracking.evidence_store import OWN, EvidenceBatch
from onboard.tracking.tracks import TrackingParameters, Tracks

A, B = b"aaaa", b"bbbb"


def measured(x_m: float, y_m: float, stamp_ms: int, sigma_m: float, by: bytes = A) -> Measurement:
    identity = MeasurementId(by, stamp_ms)
    return Measurement(identity, np.array([x_m, y_m]), np.eye(2) * sigma_m**2)


def estimated(x_m: float, y_m: float, *stamps_ms: int, by: bytes = A, sigma_m: float) -> Estimate:
    provenance = frozenset(MeasurementId(by, stamp_ms) for stamp_ms in stamps_ms)
    covariance = np.diag([sigma_m**2, sigma_m**2, 1.0, 1.0])
    return Estimate(provenance, np.array([x_m, y_m, 0.0, 0.0]), covariance)


def tell(tracks: Tracks, teller: bytes, cars: dict[int, Evidence], now_ms: int) -> list[int]:
    """Let `teller` tell of cars by his numbers, and look what comes of it."""
    pieces = list(cars.values())
    provenances = [piece.provenance for piece in pieces]
    refused = tracks.receive(
        EvidenceBatch(
            [teller] * len(pieces),
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


def test_a_car_goes_on_by_its_number_however_vague_it_is() -> None:
    tracks = Tracks()
    for k in range(4):
        tell(tracks, A, {7: measured(0, 0, 1000 + 100 * k, 1.4)}, 1050 + 100 * k)

    (track,) = tracks
    assert track.is_reported
    assert len(track.used) == 4


def test_the_first_vague_measurement_of_a_car_does_not_go_to_its_neighbour() -> None:
    """A car on the next lane, 3.5 m away, that nobody has reported before."""
    tracks = Tracks()
    for k in range(5):
        tell(tracks, A, {7: estimated(0, 0, 1000 + 100 * k, sigma_m=0.3)}, 1050 + 100 * k)

    tell(tracks, B, {1: measured(0, 2.5, 1460, 1.4, by=B)}, 1470)

    assert [len(track.used) for track in tracks] == [5, 1]
    assert [track.is_reported for track in tracks] == [True, False]


def test_a_new_number_for_a_well_known_place_is_that_car() -> None:
    tracks = Tracks()
    for k in range(3):
        tell(tracks, A, {7: estimated(0, 0, 1000 + 100 * k, sigma_m=0.3)}, 1050 + 100 * k)

    tell(tracks, B, {1: estimated(0.4, 0.3, 1260, by=B, sigma_m=0.3)}, 1270)

    (track,) = tracks
    assert set(track.labels) == {(A, 7), (B, 1)}


def test_who_shares_a_measurement_and_a_place_is_one_car_however_vague() -> None:
    tracks = Tracks()
    tell(tracks, A, {7: measured(0, 0, 1000, 1.4)}, 1050)

    tell(tracks, B, {1: estimated(0.3, 0.2, 1000, 900, sigma_m=1.2)}, 1060)

    (track,) = tracks
    assert set(track.labels) == {(A, 7), (B, 1)}


def test_a_number_that_jumps_to_another_car_is_another_car() -> None:
    tracks = Tracks()
    for k in range(4):
        tell(tracks, OWN, {7: measured(0, 0, 1000 + 100 * k, 0.3)}, 1050 + 100 * k)

    tell(tracks, OWN, {7: measured(20, 0, 1400, 0.3)}, 1450)

    first, second = tracks
    assert first.labels == {}
    assert set(second.labels) == {(OWN, 7)}


def test_two_numbers_that_turn_out_to_be_one_car_are_joined() -> None:
    """Two that see it from afar; both tell of it in vain at first, but never of two cars."""
    rng = np.random.default_rng(0)
    tracks = Tracks()
    for k in range(12):
        for at, teller in enumerate((A, B)):
            stamp_ms = 1000 + 100 * k + 30 * at
            place = rng.normal(0, 1.0, 2)
            tell(tracks, teller, {5: measured(*place, stamp_ms, 1.0, by=teller)}, stamp_ms + 10)
            assert sum(track.is_reported for track in tracks) <= 1

    (track,) = tracks
    assert {observer for observer, _ in track.estimate.provenance} == {A, B}


def test_two_that_one_picture_shows_are_never_joined() -> None:
    tracks = Tracks()
    for k in range(12):
        stamp_ms = 1000 + 100 * k
        seen: dict[int, Evidence] = {
            1: measured(0, 0, stamp_ms, 0.8),
            2: measured(0, 1.2, stamp_ms, 0.8),
        }
        tell(tracks, OWN, seen, stamp_ms + 10)

    assert len(tracks) == 2
    assert all(track.is_reported for track in tracks)


def test_a_ghost_does_not_hide_what_the_own_camera_sees() -> None:
    tracks = Tracks()
    for k in range(4):
        now_ms = 1000 + 100 * k
        tell(tracks, OWN, {1: measured(0, 0, now_ms, 0.8)}, now_ms)
        tell(tracks, B, {1: estimated(2, 0, now_ms, by=B, sigma_m=0.5)}, now_ms)

    seen, ghost = tracks
    assert np.trace(ghost.estimate.covariance[:2, :2]) < np.trace(seen.estimate.covariance[:2, :2])
    assert (seen.is_reported, ghost.is_reported) == (True, False)


def test_who_is_hidden_hides_nobody() -> None:
    """Each is the double of the one before, and vaguer; the last is no double of the first."""
    tracks = Tracks()
    for k in range(4):
        now_ms = 1000 + 100 * k
        for at in range(3):
            teller = bytes([at + 1]) * 4
            evidence = estimated(2.1 * at, 0, now_ms, by=teller, sigma_m=0.7 + 0.1 * at)
            tell(tracks, teller, {1: evidence}, now_ms)

    assert [track.is_reported for track in tracks] == [True, False, True]


def test_what_is_spent_is_not_used_again() -> None:
    tracks = Tracks()
    for k in range(8):
        tell(tracks, A, {7: measured(0, 0, 1000 + 100 * k, 0.5)}, 1050 + 100 * k)

    tell(tracks, B, {1: estimated(0, 0, 1000, 1100, 1700, sigma_m=0.3)}, 1760)

    (track,) = tracks
    used = [identity for piece in track.used for identity in piece.provenance]
    assert len(used) == len(set(used)) == 8
    assert all(isinstance(piece, Measurement) for piece in track.used)


def test_a_car_is_forgotten_with_the_last_of_its_evidence() -> None:
    """An estimate with an old measurement is dropped before the car counts as unseen."""
    tracks = Tracks()
    tell(tracks, A, {7: estimated(0, 0, 1100, 3000, sigma_m=0.5)}, 3000)
    assert len(tracks) == 1

    tracks.update(3150)

    assert len(tracks) == 0


def test_a_car_may_be_remembered_for_less_than_it_may_be_unseen() -> None:
    tracks = Tracks(TrackingParameters(unseen_s=3.0, memory_s=2.0))
    for k in range(4):
        tell(tracks, OWN, {7: measured(0, 0, 1000 + 100 * k, 0.5)}, 1000 + 100 * k)

    tracks.update(3400)

    assert len(tracks) == 0


def test_the_numbers_of_evidence_go_with_it() -> None:
    """And those of what is still held stay what they were, wherever they stand now."""
    tracks = Tracks()
    for k in range(60):
        now_ms = 1000 + 100 * k
        evidence: dict[int, Evidence] = {n: measured(50 * n, k, now_ms - n, 1.0) for n in range(30)}
        tell(tracks, OWN, evidence, now_ms)

    assert len(tracks) == 30
    held = [each for track in tracks for each in track.stored]
    assert max(each.row for each in held) < 2 * len(held) + 30
    for track in tracks:
        for piece in track.pieces:
            assert isinstance(piece, Measurement)
            tick, n = divmod(piece.stamp_ms - 1000 + track.number - 1, 100)
            assert n == 0
            assert piece.position_m.tolist() == [50.0 * (track.number - 1), tick]
