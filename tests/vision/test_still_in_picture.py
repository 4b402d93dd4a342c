"""What stays on its pixels while the scene moves is part of the camera, and no vehicle."""

from collections.abc import Iterator

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from onboard.observations import ImageBox
from onboard.vision.detection import DetectionKind
from onboard.vision.still_in_picture import REMEMBERED_S, STILL_S, StillInPicture
from sim_rig.rendering.plate_art import EU, draw_plate
from tests.vision.drive import observe
from tests.vision.test_lead import TrackedRoad, detection
from tests.vision.test_plate_drives import perception

Image = npt.NDArray[np.uint8]
WIDTH, HEIGHT = 640, 360
BOX = ImageBox(280.0, 250.0, 90.0, 20.0)
FPS = 10.0


def scenery(index: int, speed_px: float = 9.0) -> Image:
    """A textured scene, moved from frame to frame."""
    rng = np.random.default_rng(3)
    coarse = rng.uniform(70, 110, (HEIGHT // 12, 200)).astype(np.float32)
    wide = cv2.resize(coarse, (2400, HEIGHT), interpolation=cv2.INTER_CUBIC)
    left = round(speed_px * index)
    grey = wide[:, left : left + WIDTH].clip(0, 255).astype(np.uint8)
    return np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), np.uint8)


def stamped(image: Image, text: str, dx_px: float = 0.0) -> Image:
    """Letters at the box, moved by a part of a pixel."""
    at = (int((BOX.x_px + dx_px) * 16), int((BOX.y_px + 17) * 16))
    shown = image.copy()
    layer = np.zeros_like(shown)
    cv2.putText(layer, text, (at[0] // 16, at[1] // 16), 0, 0.6, (255, 255, 255), 2, cv2.LINE_AA)
    shift = np.array([[1, 0, dx_px % 1.0], [0, 1, 0]], np.float32)
    return np.maximum(shown, np.asarray(cv2.warpAffine(layer, shift, (WIDTH, HEIGHT)), np.uint8))


def watched(images: Iterator[Image], box: ImageBox = BOX) -> list[bool]:
    part = StillInPicture()
    answers = []
    for index, image in enumerate(images):
        part.receive_frame(image, box, index / FPS)
        answers.append(part.is_still(index / FPS))
    return answers


def test_letters_on_the_same_pixels_of_a_moving_scene_are_still() -> None:
    answers = watched(stamped(scenery(index), "17:42 KB") for index in range(20))

    assert answers.index(True) == pytest.approx(STILL_S * FPS, abs=1)
    assert all(answers[answers.index(True) :])


def test_a_clock_whose_seconds_change_stays_still() -> None:
    answers = watched(stamped(scenery(i), f"08:24:{i // 10:02}") for i in range(60))

    assert all(answers[10:])


def test_a_vehicle_that_was_approached_is_never_still_at_a_constant_gap() -> None:
    """On a smooth road it stays on its pixels: in the demonstration it was lost after 2 s."""
    part = StillInPicture()
    for index in range(40):
        to_go_px = max(0.0, 10.0 - 2.0 * index)
        box = ImageBox(BOX.x_px, BOX.y_px - 2.0 * to_go_px, BOX.w_px, BOX.h_px)
        part.receive_frame(stamped(scenery(index), "RD288HX"), box, index / FPS)
        assert not part.is_still(index / FPS)


@pytest.mark.parametrize("kind", [DetectionKind.PLATE, DetectionKind.VEHICLE])
def test_what_is_found_as_a_vehicle_is_never_still(kind: DetectionKind) -> None:
    """One that is followed at one gap from the first frame on, on a smooth road, stays there."""
    road, lead = TrackedRoad(needs_vehicle=True), None
    for index in range(40):
        lead = road.step(detection(20.0, text=None), detection(20.5, text=None, kind=kind))
        (track,) = road.tracker.tracks
        image = stamped(scenery(index), "RD288HX")
        track.still_in_picture.receive_frame(image, BOX, road.stamp_s)

    (track,) = road.tracker.tracks
    assert track.still_in_picture.is_still(road.stamp_s)
    assert (lead is track) is (kind is DetectionKind.VEHICLE)


def test_a_stamp_that_a_vehicle_passes_behind_stays_still() -> None:
    """One find of a vehicle made a date stamp a lead for 1.5 s."""
    road = TrackedRoad(needs_vehicle=True)
    for index in range(40):
        found = [detection(20.0, text=None)]
        if index == 30:
            found.append(detection(20.5, text=None, kind=DetectionKind.VEHICLE))
        lead = road.step(*found)
        (track,) = road.tracker.tracks
        image = stamped(scenery(index), "RD288HX")
        track.still_in_picture.receive_frame(image, BOX, road.stamp_s)
        assert index < 10 or lead is None


def test_where_the_scene_stands_nothing_is_known_to_be_still() -> None:
    assert not any(watched(stamped(scenery(0), "GN 417") for _ in range(30)))


def test_a_vehicle_that_sways_by_half_a_pixel_is_not_still() -> None:
    sway_px = [0.0, 0.6, 1.1, 0.5, -0.2]

    assert not any(watched(stamped(scenery(i), "GN 417", sway_px[i % 5]) for i in range(40)))


def test_others_that_pass_do_not_make_a_standing_scene_move() -> None:
    def passing(index: int) -> Image:
        image = stamped(scenery(0), "GN 417")
        image[60:120, 20 * index : 20 * index + 120] = 250
        return image

    assert not any(watched(passing(index) for index in range(25)))


def test_what_was_still_is_forgotten() -> None:
    images = [stamped(scenery(i), "GN 417") for i in range(11)]
    images += [stamped(scenery(i), "GN 417", 1.3 * (i % 3)) for i in range(11, 60)]

    answers = watched(iter(images))

    assert answers[10]
    last = max(index for index, answer in enumerate(answers) if answer)
    assert last / FPS == pytest.approx(1.0 + REMEMBERED_S, abs=0.3)


@pytest.mark.long
def test_a_plate_that_is_burnt_into_the_picture_is_no_lead() -> None:
    """It would be a lead for as long as it is there, at a few metres."""
    art = cv2.resize(draw_plate("GN417KB", EU, px_per_mm=1.0), (156, 34))[..., :3]
    drive: list[tuple[float, Image]] = []
    for index in range(40):
        image = np.asarray(cv2.resize(scenery(index), (1280, 720)), np.uint8)
        image[500:534, 560:716] = art
        drive.append((index / FPS, image))

    observed = observe(perception(), iter(drive))

    assert any(plate.box.y_px > 480 for plate in observed.plates)
    assert {lead.gap_m for lead in observed.leads if lead.stamp_s > STILL_S + 0.2} == {None}
