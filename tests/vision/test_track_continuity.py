"""One vehicle keeps its track through misreadings and missed frames; another one gets another."""

from dataclasses import replace

import pytest

from onboard.observations import PlateCandidate
from onboard.vision.detection import Detection
from onboard.vision.perspective import Perspective
from onboard.vision.settings import guessed_calibration
from onboard.vision.vehicle_track import VehicleTrack
from tests.vision.test_lead import STEP_S, TrackedRoad, detection

OURS, THEIRS = "RK735AS", "RK736AS"
NOTICED_STEPS = round(0.5 / STEP_S)


def read(ahead_m: float, right_m: float, *texts: tuple[str, float]) -> Detection:
    """A plate whose reading gives these texts their probabilities."""
    text, confidence = texts[0]
    return replace(
        detection(ahead_m, right_m, text),
        confidence=confidence,
        identity_confidence=confidence,
        candidates=tuple(PlateCandidate(*each) for each in texts),
    )


def ours(ahead_m: float = 20.0, right_m: float = 0.0) -> Detection:
    return read(ahead_m, right_m, (OURS, 0.97), (THEIRS, 0.02))


def theirs(ahead_m: float = 20.0, right_m: float = 0.0) -> Detection:
    return read(ahead_m, right_m, (THEIRS, 0.98), ("RK738AS", 0.01))


def track_id(track: VehicleTrack | None) -> int:
    assert track is not None
    return track.track_id


def likeliest(track: VehicleTrack | None) -> str:
    assert track is not None
    return track.candidates[0].text


def followed() -> tuple[TrackedRoad, int]:
    """A road on which our lead is known."""
    road = TrackedRoad()
    return road, track_id(road.steps(10, ours()))


def test_certain_misreadings_change_neither_track_nor_likeliest_text_at_once() -> None:
    road, before = followed()

    lead = road.steps(2, theirs())

    assert track_id(lead) == before
    assert likeliest(lead) == OURS


def test_ten_seconds_of_misreadings_do_not_change_the_track() -> None:
    road, before = followed()

    assert track_id(road.steps(100, theirs())) == before


@pytest.mark.parametrize("unread", [(), (detection(20.0, text=None),)])
def test_missed_frames_and_unread_plates_change_neither_track_nor_texts(
    unread: tuple[Detection, ...],
) -> None:
    road, before = followed()

    lead = road.steps(8, *unread)
    assert track_id(lead) == before
    assert likeliest(lead) == OURS
    assert track_id(road.steps(3, ours())) == before


def test_a_vehicle_that_cuts_in_gets_a_track_of_its_own() -> None:
    road, before = followed()

    leads = [road.step(ours(), theirs(12.0, max(0.0, 2.0 - 0.2 * index))) for index in range(15)]

    assert track_id(leads[0]) == before
    assert track_id(leads[-1]) != before
    assert likeliest(leads[-1]) == THEIRS
    assert {likeliest(each) for each in leads if track_id(each) == before} == {OURS}


@pytest.mark.parametrize("beyond_m", [24.0, 30.0, 45.0])
def test_the_vehicle_beyond_a_lead_that_turns_off_gets_a_track_of_its_own(beyond_m: float) -> None:
    road, before = followed()
    for index in range(8):
        road.step(ours(right_m=0.35 * index))

    leads = [road.step(theirs(beyond_m)) for _ in range(NOTICED_STEPS)]

    assert track_id(leads[-1]) != before
    assert likeliest(leads[-1]) == THEIRS


@pytest.mark.parametrize("ahead_m", [18.0, 20.0, 23.0])
def test_another_vehicle_after_missed_frames_gets_a_track_of_its_own(ahead_m: float) -> None:
    """As after a wiper, a tunnel's mouth or a covered lens, with one vehicle at another's place."""
    road, before = followed()
    road.steps(6)

    leads = [road.step(theirs(ahead_m)) for _ in range(NOTICED_STEPS)]

    assert track_id(leads[-1]) != before
    assert likeliest(leads[-1]) == THEIRS


def test_a_plate_that_jumps_to_another_vehicles_place_is_another_track() -> None:
    """Within the gate of a vehicle whose distance is vague, but of another text."""
    road = TrackedRoad()
    before = track_id(road.steps(10, ours(40.0)))

    leads = [road.step(theirs(48.0)) for _ in range(NOTICED_STEPS)]

    assert track_id(leads[-1]) != before


def test_a_fleet_in_both_lanes_stays_apart() -> None:
    road = TrackedRoad()
    cars = [
        (f"RK{735 + index}AS", 15.0 + 9.0 * (index // 2), 3.4 * (index % 2)) for index in range(6)
    ]

    for _ in range(30):
        road.step(
            *(
                read(ahead_m, right_m, (text, 0.6), (cars[(at + 1) % 6][0], 0.3))
                for at, (text, ahead_m, right_m) in enumerate(cars)
            )
        )

    texts = {
        (round(track.ahead.position_m), round(track.right.position_m)): likeliest(track)
        for track in road.tracker.tracks
    }
    assert texts == {(round(ahead_m), round(right_m)): text for text, ahead_m, right_m in cars}
    assert [track.track_id for track in road.tracker.tracks] == [1, 2, 3, 4, 5, 6]


def test_numbers_of_tracks_are_never_used_again() -> None:
    road, before = followed()
    road.steps(40)

    assert track_id(road.steps(5, ours())) > before


def test_a_vehicle_that_leaves_the_picture_at_a_side_has_no_track() -> None:
    """Seen 5 m ahead, it passes at the left; straight ahead, it is too near to be seen."""
    perspective = Perspective(guessed_calibration(640, 360))
    for right_m, is_kept in ((-0.3, False), (0.0, True)):
        road = TrackedRoad()
        road.tracker.receive_size((640, 360))
        for step in range(10):
            road.step(ours(5.0 - 0.3 * step, step * right_m))
        road.steps(5)

        road.tracker.drop_beside(perspective, road.stamp_s)

        assert bool(road.tracker.tracks) is is_kept
