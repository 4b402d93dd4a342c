"""Detections of plates, with a scripted finder and reader."""

from typing import cast

import numpy as np
import pytest
from typing_extensions import override

from onboard.observations import ImageBox, Lead, Plate, PlateCandidate
from onboard.vision.parameters import PerceptionParameters
from onboard.vision.perception import Perception
from onboard.vision.perspective import Perspective, RoadPosition
from onboard.vision.plate_detector import Corners, Image, PlateDetection
from onboard.vision.plate_reader import Plates, PlateText
from onboard.vision.settings import Calibration, VisionSettings
from onboard.vision.sized_camera import Networks
from onboard.vision.vehicle_finder import VehicleFinder
from tests.vision.drive import CAMERA, observe

SETTINGS = VisionSettings(tag_dictionary=None)


class Finder:
    """Finds one plate, 90 px wide."""

    def __init__(self, left_px: float) -> None:
        x0, x1 = left_px, min(left_px + 90.0, CAMERA.width_px + 2.0)
        corners = [(x0, 300), (x1, 300), (x1, 320), (x0, 320)]
        self.found = PlateDetection(np.array(corners, np.float32), 0.95)

    def find(self, image: Image, region: ImageBox | None = None) -> list[PlateDetection]:
        return [self.found]

    def find_again(self, image: Image, last: Corners) -> PlateDetection | None:
        return self.found


class Reader:
    """Returns scripted readings, one a frame."""

    def __init__(self, *reads: tuple[str, float]) -> None:
        self._reads = list(reads)

    def read_many(self, image: Image, plates: Plates) -> list[PlateText]:
        text, confidence = self._reads.pop(0)
        candidates = (PlateCandidate(text, confidence),)
        return [PlateText(text, confidence, confidence, candidates)]


def plates(finder: Finder, *reads: tuple[str, float]) -> list[Plate]:
    rng = np.random.default_rng(1)
    always = PerceptionParameters(read_period_s=0.0, read_period_identified_s=0.0)
    perception = Perception(CAMERA, SETTINGS, Networks(finder, Reader(*reads)), always)
    reported = []
    for index in range(len(reads)):
        perception.receive_frame(rng.integers(0, 255, (540, 960, 3), np.uint8), index / 10)
        while (event := perception.next_event()) is not None:
            reported += [event] if isinstance(event, Plate) else []
    return reported


class MovingFinder(Finder):
    """Its plate is too far from the last position to be found again."""

    @override
    def find_again(self, image: Image, last: Corners) -> PlateDetection | None:
        return None


def test_a_plate_that_is_not_found_again_is_searched_around_in_the_same_frame() -> None:
    reader = Reader(*[("GN417KB", 0.9)] * 15)
    perception = Perception(CAMERA, SETTINGS, Networks(MovingFinder(400.0), reader))
    image = np.random.default_rng(1).integers(0, 255, (540, 960, 3), np.uint8)
    for index in range(15):
        perception.receive_frame(image // 2 + np.uint8(index), index / 15)
        found = []
        while (event := perception.next_event()) is not None:
            found += [event] if isinstance(event, Plate) else []
        assert found, index


@pytest.mark.parametrize("left_px", [-60.0, 0.0, 890.0, 930.0])
def test_a_plate_cut_off_at_the_border_is_never_certain(left_px: float) -> None:
    (plate,) = plates(Finder(left_px), ("B2414", 0.96))

    assert plate.text == "B2414"
    assert plate.confidence < 0.5


def test_a_readings_confidence_is_limited_by_the_other_readings() -> None:
    reported = plates(
        Finder(435.0), ("CMW2245", 0.5), ("CWW2245", 0.8), ("CWM2245", 0.7), ("CMW2245", 0.97)
    )

    assert [plate.text for plate in reported] == ["CMW2245", "CWW2245", None, "CMW2245"]
    assert reported[1].confidence < 0.75


def test_an_identified_track_keeps_its_text_in_frames_with_bad_readings() -> None:
    reported = plates(Finder(435.0), *[("GN417KB", 0.99)] * 4, ("GN417K8", 0.4), ("GN417KB", 0.99))

    assert {plate.text for plate in reported} == {"GN417KB"}
    assert reported[4].confidence >= 0.9


def test_a_certain_reading_that_all_others_rule_out_is_reported_without_text() -> None:
    reported = plates(Finder(435.0), *[("GN417KB", 0.99)] * 5, ("RD288HX", 0.95))

    assert (reported[-1].text, reported[-1].confidence) == (None, 0.0)


def test_a_text_that_other_readings_rule_out_is_not_reported() -> None:
    reported = plates(Finder(400.0), *[("AB123CD", 0.8)] * 5, ("XY987ZW", 0.2))

    assert (reported[-1].text, reported[-1].confidence) == (None, 0.0)


@pytest.mark.parametrize("pitch_rad", [-0.12, 0.12])
def test_a_camera_with_only_its_lens_calibrated_may_be_pitched(pitch_rad: float) -> None:
    """A plate 0.6 m over the road, 9.5 m ahead of a camera that is assumed to be level."""
    lens = CAMERA.model_dump(exclude={"source", "fps", "pitch_rad", "mounting_height_m", "yaw_rad"})
    mounted = Calibration(**lens, pitch_rad=pitch_rad)
    art = Perspective(mounted)
    quad = art.project_all(
        [
            RoadPosition(9.5, x, y)
            for x, y in ((-0.26, 0.655), (0.26, 0.655), (0.26, 0.545), (-0.26, 0.545))
        ]
    )
    finder = Finder(0.0)
    finder.found = PlateDetection(quad.astype(np.float32), 0.95)
    perception = Perception(
        Calibration(**lens), SETTINGS, Networks(finder, Reader(*[("GN417KB", 0.9)] * 5))
    )
    rng = np.random.default_rng(1)
    leads = []
    for index in range(5):
        perception.receive_frame(rng.integers(0, 255, (540, 960, 3), np.uint8), index / 10)
        while (event := perception.next_event()) is not None:
            leads += [event] if isinstance(event, Lead) else []

    assert leads[-1].gap_m == pytest.approx(9.5, rel=0.1)


@pytest.mark.parametrize(("text", "are_vehicles"), [("", False), ("GN417KB", True)])
def test_where_vehicles_are_found_an_unread_plate_alone_is_no_detected_vehicle(
    text: str, *, are_vehicles: bool
) -> None:
    """Guard rails and signs may look like plates."""
    nothing = cast("VehicleFinder", object())  # is no detector: it finds none
    networks = Networks(Finder(435.0), Reader(*[(text, 0.99)] * 20), nothing)
    perception = Perception(CAMERA, SETTINGS, networks)
    rng = np.random.default_rng(1)
    drive = ((i / 10, rng.integers(0, 255, (540, 960, 3), np.uint8)) for i in range(12))

    observed = observe(perception, drive)

    assert observed.plates
    assert bool(observed.cars) == bool(perception.vehicles) == are_vehicles
