"""The lead is the nearest vehicle in the host vehicle's lane; detections are given."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from onboard.observations import Curvature, PlateCandidate
from onboard.vision.detection import Detection, DetectionKind
from onboard.vision.frame_admission import AdmittedFrame
from onboard.vision.lane import HostLane
from onboard.vision.lead import LeadSelector
from onboard.vision.parameters import DEFAULT_PARAMETERS
from onboard.vision.perspective import Corners, RoadPosition
from onboard.vision.plate_formats import PlateFormats
from onboard.vision.search_schedule import SearchSchedule
from onboard.vision.sized_camera import SizedCamera
from onboard.vision.tracker import Tracker
from onboard.vision.vehicle_track import VehicleTrack

LANE_M = 3.5
STEP_S = 0.1


def detection(
    ahead_m: float,
    right_m: float = 0.0,
    text: str | None = "GN417KB",
    kind: DetectionKind = DetectionKind.PLATE,
    height_m: float = 0.6,
) -> Detection:
    return Detection(
        kind=kind,
        corners_px=np.zeros((4, 2), np.float32),
        position=RoadPosition(ahead_m, right_m, height_m),
        ahead_sigma_m=0.02 * ahead_m,
        right_sigma_m=0.1,
        text=text,
        confidence=0.0 if text is None else 0.95,
        identity_confidence=0.0 if text is None else 0.95,
        candidates=() if text is None else (PlateCandidate(text, 0.99),),
    )


@dataclass
class TrackedRoad:
    """Runs tracker and selection with one list of detections a step."""

    needs_vehicle: bool = False

    def __post_init__(self) -> None:
        self.tracker = Tracker(LANE_M)
        self.lane = HostLane(LANE_M)
        self.choice = LeadSelector(self.lane, needs_vehicle=self.needs_vehicle)
        self.stamp_s = 0.0

    def step(self, *detections: Detection) -> VehicleTrack | None:
        self.stamp_s += STEP_S
        self.tracker.receive_detections(list(detections), self.stamp_s)
        return self.choice.select(self.tracker.tracks, self.stamp_s)

    def steps(self, count: int, *detections: Detection) -> VehicleTrack | None:
        lead = None
        for _ in range(count):
            lead = self.step(*detections)
        return lead


def test_an_empty_road_has_no_lead() -> None:
    assert TrackedRoad().step() is None


def test_a_vehicle_is_the_lead_from_its_third_detection() -> None:
    road = TrackedRoad()

    assert road.steps(2, detection(20.0)) is None
    lead = road.step(detection(20.0))

    assert lead is not None
    assert lead.ahead.position_m == pytest.approx(20.0)


def test_in_a_bend_the_lead_is_the_vehicle_on_the_path_and_not_the_one_straight_ahead() -> None:
    """At a radius of 150 m, the lane 32 m ahead is where the next lane is on a straight road."""
    road = TrackedRoad()
    on_path, next_lane = detection(32.0, 3.8, "GN417KB"), detection(31.0, 0.3, "RD288HX")
    road.lane.receive_curvature(Curvature(0.0, 1 / 150, 1e-4))

    lead = road.steps(5, on_path, next_lane)

    assert lead is not None
    assert lead.text == "GN417KB"


def test_a_lead_does_not_leave_the_lane_while_the_path_is_uncertain() -> None:
    for sigma_1_m, is_kept in ((0.0, False), (1 / 300, True)):
        road = TrackedRoad()
        road.lane.receive_curvature(Curvature(0.0, 0.0, sigma_1_m))
        assert road.steps(5, detection(32.0)) is not None

        moved = [detection(32.0, 0.3 * step) for step in range(9)]
        leads = [road.step(each) for each in moved]

        assert (leads[-1] is not None) is is_kept


def box_corners(left: float, top: float, wide: float, high: float) -> Corners:
    right, bottom = left + wide, top + high
    return np.array([(left, top), (right, top), (right, bottom), (left, bottom)], np.float32)


def unread(ahead_m: float) -> Detection:
    return detection(ahead_m, text=None)


def found_vehicle(ahead_m: float) -> Detection:
    return detection(ahead_m, text=None, kind=DetectionKind.VEHICLE)


def test_where_vehicles_are_found_an_unread_plate_alone_is_no_lead() -> None:
    road = TrackedRoad(needs_vehicle=True)

    assert road.steps(10, unread(20.0)) is None
    assert road.choice.has_candidate(road.tracker.tracks, road.stamp_s)
    assert road.step(unread(20.0), found_vehicle(20.5)) is not None
    assert not road.choice.has_candidate(road.tracker.tracks, road.stamp_s)


def test_a_lane_through_which_a_vehicle_passes_is_not_free() -> None:
    """It crosses at 3 m/s, and is beyond the lane a second later: no lead."""
    road = TrackedRoad()

    for step in range(12):
        right_m = 2.1 - 0.3 * step
        assert road.step(detection(16.0, right_m)) is None
        if step >= 5 and abs(right_m) < 1.0:
            assert road.choice.has_candidate(road.tracker.tracks, road.stamp_s)


def test_the_plate_of_a_vehicle_that_comes_into_the_lane_is_read_in_every_frame() -> None:
    road, schedule = TrackedRoad(), SearchSchedule(DEFAULT_PARAMETERS, finds_vehicles=False)
    camera = cast("SizedCamera", SimpleNamespace(road=None))
    image = np.zeros((1, 1, 3), np.uint8)

    def step(coming_m: float) -> set[float]:
        """Lateral positions of the vehicles whose plates are read."""
        detections = [
            replace(detection(ahead_m, right_m, None), corners_px=np.full((4, 2), right_m))
            for ahead_m, right_m in ((16.0, coming_m), (14.0, -3.5))
        ]
        assert road.step(*detections) is None
        tracks = road.tracker.tracks
        frame = AdmittedFrame(image, road.stamp_s, camera, *[False] * 4)
        plan = schedule.next_plan(frame, tracks, None, road.choice.entering(tracks))
        regions = (*(plan.tracked or ()), *plan.known)
        return {float(each.corners_px[0, 0]) for each in regions if each.read_text}

    beside = [step(3.5) for _ in range(8)]
    coming_m = [3.5 - 0.15 * index for index in range(14)]
    coming = [each in step(each) for each in coming_m]

    assert sum(3.5 in read for read in beside) <= 2
    assert all(coming[9:])


def test_a_plate_is_no_lead_any_more_when_no_vehicle_is_found_around_it() -> None:
    road = TrackedRoad(needs_vehicle=True)
    assert road.steps(5, unread(20.0), found_vehicle(20.5)) is not None

    assert road.steps(round(1.0 / STEP_S), unread(20.0)) is not None
    assert road.steps(round(1.0 / STEP_S), unread(20.0)) is None


def test_a_plate_with_a_certain_text_is_a_lead_although_no_vehicle_is_found() -> None:
    assert TrackedRoad(needs_vehicle=True).steps(5, detection(20.0)) is not None


def test_a_vehicle_whose_width_is_misjudged_does_not_make_its_plate_inconsistent() -> None:
    """A rear that looks 1.3 times as wide: the lead was lost as long as its plate was not read."""
    road = TrackedRoad(needs_vehicle=True)
    wide = replace(found_vehicle(15.4), ahead_sigma_m=1.4)

    leads = [road.step(unread(20.0), wide) for _ in range(20)]

    assert None not in leads[3:]


def test_a_plate_beside_a_vehicle_in_the_image_is_not_on_it() -> None:
    """A sign over the road, as far as a vehicle beside that the image's border cuts."""
    road = TrackedRoad(needs_vehicle=True)
    sign = replace(unread(4.0), corners_px=box_corners(460.0, 40.0, 80.0, 40.0))
    cut = replace(
        found_vehicle(4.5),
        corners_px=box_corners(0.0, 200.0, 120.0, 160.0),
        position=RoadPosition(4.5, -1.6, 0.6),
        ahead_sigma_m=4.5,
        right_sigma_m=1.6,
    )

    assert road.steps(10, sign, cut) is not road.tracker.tracks[0]
    assert not any(track.has_vehicle for track in road.tracker.tracks if track.last is sign)


def test_a_vehicle_beside_a_plate_that_was_not_seen_for_a_while_is_not_around_it() -> None:
    """After 0.25 s anything as far was: a car 170 px away made a stamp the lead for 1.5 s."""
    road = TrackedRoad(needs_vehicle=True)
    stamp = replace(unread(20.0), corners_px=box_corners(460.0, 300.0, 20.0, 6.0))
    car = replace(found_vehicle(20.5), corners_px=box_corners(630.0, 280.0, 60.0, 50.0))
    road.steps(5, stamp)
    (track,) = road.tracker.tracks
    road.steps(4)

    road.step(car)

    assert not track.has_vehicle


@pytest.mark.parametrize("ahead_m", [(20.0, 34.0), (12.0, 30.0)])
def test_a_lead_whose_detections_leap_as_no_body_does_is_none(ahead_m: tuple[float, float]) -> None:
    """A patch of shadow and a guard rail were: what was a lead once was not asked any more."""
    road = TrackedRoad()
    lead = road.steps(5, found_vehicle(ahead_m[0]))
    assert lead is not None
    (track,) = road.tracker.tracks

    for leap_m in ahead_m[::-1] * 5:
        road.stamp_s += STEP_S
        track.predict(road.stamp_s)
        track.update(found_vehicle(leap_m), road.stamp_s)
        lead = road.choice.select([track], road.stamp_s)

    assert lead is None


@pytest.mark.parametrize(("by_width_m", "is_lead"), [(8.0, True), (6.7, True), (30.0, False)])
def test_a_vehicle_is_as_wide_as_its_gap_says(by_width_m: float, is_lead: bool) -> None:
    """A box of 26 px held a lead at 6.7 m."""
    road = TrackedRoad()
    found = replace(found_vehicle(6.7), ahead_by_size_m=by_width_m)

    assert (road.steps(10, found) is not None) is is_lead


def test_one_box_of_another_size_does_not_end_a_lead() -> None:
    """A lead was unknown in each frame in which its box was a little longer than a rear's."""
    road = TrackedRoad()
    usual = replace(found_vehicle(20.0), ahead_by_size_m=20.0)
    lead = road.steps(10, usual)

    assert road.step(replace(usual, ahead_by_size_m=38.0)) is lead


def test_a_vehicle_that_is_predicted_behind_the_camera_is_found_anew() -> None:
    """The camera stalled for 0.7 s behind a lead that came nearer by 12 m/s."""
    road = TrackedRoad()
    for step in range(15):
        ahead_m = 24.0 - 1.2 * step
        road.step(replace(found_vehicle(ahead_m), ahead_by_size_m=ahead_m))

    road.stamp_s += 0.7
    near = replace(found_vehicle(2.0), ahead_by_size_m=2.0)
    road.step(near)

    assert road.steps(4, near) is not None


def test_what_only_optical_flow_holds_gives_way_to_the_same_vehicle_that_is_found() -> None:
    """The flow slid off a lead, whose vehicle was found a car's length beyond."""
    road = TrackedRoad()
    held, found = found_vehicle(20.0), found_vehicle(23.0)
    road.tracker.tracks = [
        VehicleTrack(n, each, 0.0, PlateFormats()) for n, each in enumerate((held, found))
    ]
    slid, track = road.tracker.tracks
    lead = None
    for _ in range(10):
        road.stamp_s += STEP_S
        for each, seen in ((slid, held), (track, found)):
            each.predict(road.stamp_s)
            if each is track or road.stamp_s < 0.45:
                each.update(seen, road.stamp_s)
        slid.observed_at = road.stamp_s
        lead = road.choice.select([slid, track], road.stamp_s)

    assert lead is track


def test_a_lead_that_is_missed_is_not_taken_for_the_vehicle_beside_it() -> None:
    """With a guessed lens, vehicles of all lanes may seem to be within one lane's width."""
    road = TrackedRoad(needs_vehicle=True)
    ahead = replace(found_vehicle(26.0), corners_px=box_corners(476.0, 300.0, 15.0, 13.0))
    beside = replace(
        ahead,
        corners_px=box_corners(413.0, 298.0, 27.0, 23.0),
        position=RoadPosition(25.0, -1.4, 0.6),
        right_sigma_m=0.3,
    )

    lead = road.steps(5, ahead)
    assert lead is not None
    assert road.steps(2, beside) is lead
    assert lead.right.position_m == pytest.approx(0.0, abs=0.1)


def test_a_vehicle_without_a_plate_is_a_lead() -> None:
    assert TrackedRoad(needs_vehicle=True).steps(5, found_vehicle(20.0)) is not None


def test_what_is_nearer_than_the_bonnet_is_no_lead() -> None:
    assert TrackedRoad().steps(10, detection(0.6)) is None


def test_detections_that_leap_about_are_no_lead() -> None:
    road = TrackedRoad()

    leads = [road.step(detection(ahead_m, text=None)) for ahead_m in [8.0, 10.5, 7.0] * 2]

    assert leads == [None] * 6


def test_what_was_detected_for_a_moment_is_not_kept_by_optical_flow() -> None:
    road = TrackedRoad()
    lead = road.steps(3, unread(10.0))
    assert lead is not None

    held = 0
    while road.tracker.tracks and held < 50:
        lead.observed_at = road.stamp_s + STEP_S  # the rear is found again
        road.step()
        held += 1

    assert held * STEP_S == pytest.approx(0.2 + 0.4, abs=0.11)


def test_a_single_detection_is_no_lead() -> None:
    road = TrackedRoad()
    road.step(detection(20.0))
    road.steps(8)

    assert road.tracker.tracks == []


@pytest.mark.parametrize("right_m", [-3.5, -2.0, 2.0, 3.5])
def test_a_near_vehicle_in_the_next_lane_is_no_lead(right_m: float) -> None:
    road = TrackedRoad()

    lead = road.steps(20, detection(8.0, right_m, "YW903MS"), detection(30.0, 0.3, None))

    assert lead is not None
    assert lead.ahead.position_m == pytest.approx(30.0, abs=0.1)
    assert lead.text is None


def test_the_nearer_of_two_vehicles_in_the_lane_is_the_lead() -> None:
    lead = TrackedRoad().steps(5, detection(40.0, 0.0, "FAR1"), detection(15.0, 0.5, "NEAR1"))

    assert lead is not None
    assert lead.text == "NEAR1"


def test_a_lead_keeps_its_identity_while_its_plate_is_illegible() -> None:
    road = TrackedRoad()
    road.steps(10, detection(20.0))

    lead = road.steps(20, detection(20.0, 0.0, None))

    assert lead is not None
    assert lead.text == "GN417KB"


def test_an_unobserved_lead_is_predicted_for_a_while() -> None:
    road = TrackedRoad()
    for index in range(20):
        road.step(detection(30.0 - 0.2 * index))

    lead = road.steps(10)

    assert lead is not None
    assert lead.ahead.position_m == pytest.approx(30.0 - 0.2 * 29, abs=0.5)
    assert road.steps(6) is None


def test_a_missed_frame_does_not_hand_the_lead_to_a_car_beyond_it() -> None:
    road = TrackedRoad()
    far = detection(40.0, 0.0, "FAR1")
    road.steps(10, detection(15.0, 0.0, "NEAR1"), far)

    assert (lead := road.steps(3, far)) is not None
    assert lead.text == "NEAR1"


def test_an_unobserved_lead_gives_way_to_a_vehicle_observed_behind_it() -> None:
    road = TrackedRoad()
    far = detection(40.0, 0.0, "FAR1")
    road.steps(10, detection(15.0, 0.0, "NEAR1"), far)

    assert (lead := road.steps(6, far)) is not None
    assert lead.text == "FAR1"


def test_a_vehicle_that_cuts_in_becomes_the_lead_in_the_lane() -> None:
    road = TrackedRoad()
    leads = []
    for index in range(40):
        right_m = max(0.0, 3.5 - 0.12 * index)
        lead = road.step(detection(30.0, 0.0, "OLD1"), detection(12.0, right_m, "CUTIN"))
        leads.append((right_m, lead.text if lead else None))

    assert all(text != "CUTIN" for right_m, text in leads if right_m > 0.5 * LANE_M)
    assert all(text == "CUTIN" for right_m, text in leads if right_m < 0.2 * LANE_M)


def test_a_lead_that_leaves_the_lane_is_no_lead_any_more() -> None:
    road = TrackedRoad()
    road.steps(10, detection(20.0))
    leads = []
    for index in range(40):
        right_m = min(3.5, 0.12 * index)
        leads.append((right_m, road.step(detection(20.0, right_m))))

    assert all(lead is not None for right_m, lead in leads if right_m < 0.4 * LANE_M)
    assert all(lead is None for right_m, lead in leads if right_m > 0.7 * LANE_M)


def test_parked_cars_in_bends_are_not_leads() -> None:
    """A bend to the left of 25 m, at 6 m/s; they stand 3 m beside the middle of the lane."""
    road = TrackedRoad()
    leads = []
    for index in range(40):
        on_the_road_m = [20.0 + 9.0 * car - 6.0 * STEP_S * index for car in range(4)]
        places = [(s, 3.0 - s**2 / 50.0) for s in on_the_road_m if 2.0 < s < 13.0]
        leads.append(road.step(*(detection(ahead_m, right_m) for ahead_m, right_m in places)))

    assert leads == [None] * 40


@pytest.mark.parametrize("right_m", [-1.0, 0.5, 1.0])
def test_a_vehicle_off_the_middle_of_the_lane_is_a_lead(right_m: float) -> None:
    assert TrackedRoad().steps(5, detection(13.0, right_m)) is not None


def test_a_vehicle_on_the_line_does_not_toggle() -> None:
    road = TrackedRoad()
    road.steps(10, detection(20.0, 1.0))
    rng = np.random.default_rng(5)
    leads = [road.step(detection(20.0, 1.55 + rng.normal(0.0, 0.1))) for _ in range(100)]

    assert all(lead is not None for lead in leads)


@pytest.mark.parametrize("steps_away", [6, 9, 12])
def test_a_detection_a_vehicles_length_behind_an_unobserved_lead_is_another_vehicle(
    steps_away: int,
) -> None:
    """It turned off; the vehicle before it is too far away to be read, and its distance is
    rough."""
    road = TrackedRoad()
    road.steps(10, detection(6.0))
    road.steps(steps_away)

    lead = road.steps(8, detection(12.5, text=None))

    assert lead is not None
    assert lead.text is None
    assert lead.ahead.position_m == pytest.approx(12.5, rel=0.02)


def test_a_lead_found_again_near_its_prediction_is_the_same() -> None:
    road, rate_m_s = TrackedRoad(), 4.0
    for step in range(10):
        road.step(detection(10.0 + rate_m_s * STEP_S * step))
    road.steps(10)

    lead = road.step(detection(10.0 + rate_m_s * STEP_S * 20, text=None))

    assert lead is not None
    assert lead.text == "GN417KB"


def test_another_plate_at_another_position_is_another_vehicle() -> None:
    road = TrackedRoad()
    road.steps(10, detection(25.0, 0.0, "OLD1"))
    lead = road.steps(3, detection(25.0, 0.0, "OLD1"), detection(10.0, 0.0, "NEW1"))

    assert lead is not None
    assert lead.text == "NEW1"


def test_two_plates_on_one_vehicle_are_one_track_with_its_first_plate() -> None:
    road = TrackedRoad()
    upper, lower = detection(20.0, 0.0, "RACK1", height_m=1.0), detection(20.0, 0.2, "GN417KB")
    road.steps(3, lower)
    for index in range(30):
        road.step(*((upper, lower) if index % 2 else (lower, upper)))

    assert [track.text for track in road.tracker.tracks] == ["GN417KB"]


@pytest.mark.parametrize("beside_m", [0.6, 0.9])
def test_two_plates_side_by_side_are_one_track_with_its_first_plate(beside_m: float) -> None:
    road = TrackedRoad()
    left, right = detection(7.0, 0.0, "GN417KB"), detection(7.1, beside_m, "SHOW1")
    road.steps(3, left)
    for index in range(30):
        road.step(*((left, right), (right, left), (left,))[index % 3])

    assert [track.text for track in road.tracker.tracks] == ["GN417KB"]


def test_motorcycles_side_by_side_are_two_tracks() -> None:
    road = TrackedRoad()
    road.steps(10, detection(10.0, 0.0, "LEFT1"), detection(10.0, 1.3, "RIGHT1"))

    assert [track.text for track in road.tracker.tracks] == ["LEFT1", "RIGHT1"]


def test_a_tag_and_a_plate_on_one_vehicle_are_one_track_identified_by_its_tag() -> None:
    road = TrackedRoad()
    road.steps(10, detection(10.0), detection(10.1, 0.1, "TAG7", DetectionKind.TAG, 0.8))

    assert [track.text for track in road.tracker.tracks] == ["TAG7"]


def test_vehicles_abreast_keep_their_tracks() -> None:
    road = TrackedRoad()
    rng = np.random.default_rng(6)
    for index in range(100):
        ahead_m = 20.0 + 5.0 * np.sin(0.1 * index) + rng.normal(0.0, 0.2)
        observed = [
            detection(ahead_m, 0.0, "MIDDLE"),
            detection(40.0 - ahead_m, 3.5, "RIGHT"),
            detection(22.0, -3.5, "LEFT"),
        ]
        rng.shuffle(observed)
        road.step(*[each for each in observed if rng.random() < 0.8])

    texts = {track.text: track.right.position_m for track in road.tracker.tracks}
    assert texts == {
        "MIDDLE": pytest.approx(0.0, abs=0.3),
        "RIGHT": pytest.approx(3.5, abs=0.3),
        "LEFT": pytest.approx(-3.5, abs=0.3),
    }


def test_a_lane_for_model_cars_is_a_lane_too() -> None:
    tracker, choice = Tracker(0.3), LeadSelector(HostLane(0.3))
    lead = None
    for index in range(10):
        cars = [
            Detection(
                DetectionKind.TAG,
                np.zeros((4, 2), np.float32),
                RoadPosition(ahead_m, right_m, 0.04),
                0.005,
                0.005,
                text,
                1.0,
                identity_confidence=1.0,
                candidates=(PlateCandidate(text, 1.0),),
            )
            for ahead_m, right_m, text in ((0.5, 0.0, "TAG1"), (0.4, 0.3, "TAG2"))
        ]
        stamp_s = index * STEP_S
        tracker.receive_detections(cars, stamp_s)
        lead = choice.select(tracker.tracks, stamp_s)

    assert len(tracker.tracks) == 2
    assert lead is not None
    assert lead.text == "TAG1"
