"""A turned, dirty, blurred or over-exposed camera is reported as such, a clear one is not."""

import math
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest

from onboard.observations import Impairment, Lead, SensorImpaired
from onboard.vision.blur import detail
from onboard.vision.focus_of_expansion import focus_of_expansion
from onboard.vision.frame_admission import AdmittedFrame, FrameAdmission
from onboard.vision.frames import Image
from onboard.vision.networks import load_perception
from onboard.vision.perspective import Perspective, RoadPosition
from onboard.vision.picture_watch import (
    DARK_SIGMA,
    LEAST_FOCUSES,
    LEAST_HEADINGS,
    RANGE_SIGMA,
    PictureWatch,
)
from onboard.vision.recordings import VideoFile
from onboard.vision.settings import Calibration, VisionSettings, guessed_calibration
from onboard.vision.sized_camera import Networks, SizedCameras
from sim_rig.rendering.scene import Scene
from tests.vision.drive import CAMERA, RENDERER
from tests.vision.test_horizon import smears

SIZE = 640, 360
LENS = guessed_calibration(*SIZE)
LANE_M, CAMERA_FPS = 3.5, 15.0
HEADINGS_RAD = {
    "barrier-shadow": (-0.100, -0.175),
    "empty-lane-540p": (-0.007, 0.037),
    "gantries-360p": (0.006, -0.002),
    "motorway-720p": (0.028, 0.045),
    "night-street": (-0.002, -0.033),
    "small-leads-320p": (0.000, -0.077),
}
"""Where each clip's vehicle heads, to the right and down from the middle of its picture, for a lens
of 60 degrees: the median of its focuses of expansion."""
Disturbance = Callable[[Image], Image]


def turned(right_deg: float, down_deg: float) -> Disturbance:
    """What a camera turned by so much about its own axes would see, for a lens of 60 degrees."""

    def disturb(image: Image) -> Image:
        height_px, width_px = image.shape[:2]
        focal_px = 0.5 * width_px / math.tan(math.radians(30))
        lens = np.array([[focal_px, 0, width_px / 2], [0, focal_px, height_px / 2], [0, 0, 1]])
        turn, _ = cv2.Rodrigues(np.radians([down_deg, -right_deg, 0.0]))
        matrix = lens @ turn @ np.linalg.inv(lens)
        return np.asarray(cv2.warpPerspective(image, matrix, (width_px, height_px)), np.uint8)

    return disturb


def motion_blurred(image: Image) -> Image:
    """Blurred sideways by what 9 px are of 1242."""
    length_px = round(image.shape[1] * 9 / 1242)
    return np.asarray(cv2.blur(image, (length_px, 1)), np.uint8)


def dark(image: Image) -> Image:
    """With a gamma of 3."""
    return np.asarray(255 * (image / 255) ** 3.0, np.uint8)


def bright(image: Image) -> Image:
    return np.asarray(np.clip(3.0 * image.astype(np.float32) + 20.0, 0, 255), np.uint8)


def admitted(
    images: Iterator[tuple[float, Image]], calibration: Calibration
) -> Iterator[AdmittedFrame]:
    admission = FrameAdmission(SizedCameras(calibration, VisionSettings(), Networks()))
    for stamp_s, image in images:
        frame = admission.admit(image, stamp_s)
        if isinstance(frame, AdmittedFrame) and not frame.is_repeat:
            yield frame


def mounted(lens: Calibration, right_rad: float, down_rad: float) -> Calibration:
    """The camera that sees the vehicle head so far to the right and down."""
    mounting = {"pitch_rad": -down_rad, "yaw_rad": -right_rad}
    return Calibration(**(lens.model_dump() | mounting))


def watched(
    images: Iterator[tuple[float, Image]], calibration: Calibration
) -> tuple[list[SensorImpaired], float]:
    """What is reported, and the largest sigma of ranges."""
    return watched_by(PictureWatch(LANE_M), images, calibration)


def watched_by(
    watch: PictureWatch,
    images: Iterator[tuple[float, Image]],
    calibration: Calibration,
    legibility: float = 0.0,
) -> tuple[list[SensorImpaired], float]:
    events, sigma = [], 0.0
    for frame in admitted(images, calibration):
        events += watch.receive_frame(frame, [], legibility)
        sigma = max(sigma, watch.range_sigma)
    return events, sigma


def approached(
    focus_px: tuple[float, float], seconds: int = LEAST_FOCUSES + 2
) -> Iterator[tuple[float, Image]]:
    """A wall that one drives at: pairs of pictures that grow from the focus, one pair a second."""
    width_px, height_px = SIZE
    for second in range(seconds):
        rng = np.random.default_rng(second)
        wall = rng.integers(60, 190, (height_px // 8, width_px // 8, 3), np.uint8)
        image = np.asarray(cv2.resize(wall, SIZE, interpolation=cv2.INTER_NEAREST), np.uint8)
        yield float(second), image
        growth = cv2.getRotationMatrix2D(focus_px, 0.0, 1.03)
        yield second + 0.1, np.asarray(cv2.warpAffine(image, growth, SIZE), np.uint8)


def test_a_camera_that_changes_its_size_between_two_pictures_is_not_impaired() -> None:
    focus_px = Perspective(LENS).project(RoadPosition(1e6, 0.0, 0.0))
    drive = (
        (stamp_s, image if stamp_s.is_integer() else image[::2, ::2])
        for stamp_s, image in approached(focus_px)
    )

    assert watched(drive, mounted(LENS, 0.0, 0.0)) == ([], 0.0)


def of_clip(rig_data: Path, clip: str, disturb: Disturbance) -> tuple[list[SensorImpaired], float]:
    """The same of a clip at some 15 pictures a second."""
    video = VideoFile(str(rig_data / "clips" / f"{clip}.mp4"), None)
    every = max(1, round(video.fps / CAMERA_FPS))
    frames = [each for index, each in enumerate(video) if index % every == 0]
    height_px, width_px = frames[0].image.shape[:2]
    images = ((each.stamp_s, disturb(each.image)) for each in frames)
    lens = guessed_calibration(width_px, height_px)
    return watched(images, mounted(lens, *HEADINGS_RAD[clip]))


def test_the_focus_of_expansion_is_found() -> None:
    (_, before), (_, now) = islice(approached((400.0, 150.0)), 2)
    focus = focus_of_expansion(detail(before), detail(now))

    assert focus is not None
    assert focus == pytest.approx((400.0, 150.0), abs=3.0)
    assert focus_of_expansion(detail(before), detail(before)) is None


@pytest.mark.parametrize(("right_deg", "down_deg"), [(-4.0, 0.0), (0.0, 4.0)])
def test_a_camera_that_heads_elsewhere_than_calibrated_is_turned(
    right_deg: float, down_deg: float
) -> None:
    focus_px = Perspective(LENS).project(
        RoadPosition(
            1e6, 1e6 * math.tan(math.radians(right_deg)), -1e6 * math.tan(math.radians(down_deg))
        )
    )
    watch = PictureWatch(LANE_M)
    turned_events, sigma = watched_by(watch, approached(focus_px), mounted(LENS, 0.0, 0.0))
    right_rad, down_rad = math.radians(right_deg), math.radians(down_deg)
    clear_events, _ = watched(approached(focus_px), mounted(LENS, right_rad, down_rad))

    assert [event.impairments for event in turned_events] == [(Impairment.TURNED,)]
    assert sigma == RANGE_SIGMA[Impairment.TURNED]
    assert watch.bearing_sigma_rad == pytest.approx(abs(right_rad), abs=0.01)
    assert clear_events == []


def test_nothing_is_said_of_dirt_while_a_camera_is_turned() -> None:
    camera, middle_px = mounted(LENS, 0.0, 0.0), SIZE[1] // 2
    ahead_px = Perspective(LENS).project(RoadPosition(1e6, 0.0, 0.0))
    aside_px = Perspective(LENS).project(RoadPosition(1e6, 1e5, 0.0))
    before = list(approached(ahead_px))
    after_s = before[-1][0] + 1.0
    after = [(after_s + stamp_s, image) for stamp_s, image in approached(aside_px, 25)]
    smeared = [(stamp_s, image.copy()) for stamp_s, image in (*before, *after)]
    for _, image in smeared:
        image[middle_px - 30 : middle_px + 30] = 128
    events, _ = watched(iter(smeared), camera)

    assert [event.impairments for event in events] == [(Impairment.DIRTY,), (Impairment.TURNED,)]


def test_a_camera_of_unknown_mounting_is_taken_to_look_where_the_vehicle_heads() -> None:
    (ahead_px, _), tag_px = Perspective(LENS).project(RoadPosition(1e6, -2.5e5, 0.0)), 48
    tags = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    grey = tags.generateImageMarker(1, tag_px - 8)
    tag = cv2.copyMakeBorder(grey, 4, 4, 4, 4, cv2.BORDER_CONSTANT, value=255)[..., None]
    perception = load_perception(None, VisionSettings(plates=False, tag_side_m=1.0))
    left_px, top_px = round(ahead_px) - tag_px // 2, SIZE[1] // 2 - tag_px // 2
    seen_s = []
    for stamp_s, image in approached((ahead_px, SIZE[1] / 2)):
        image[top_px : top_px + tag_px, left_px : left_px + tag_px] = tag
        perception.receive_frame(image, stamp_s)
        while (event := perception.next_event()) is not None:
            if isinstance(event, Lead) and event.gap_m is not None:
                seen_s.append(stamp_s)

    # Until then the tag is 3.5 m beside the lane, at 14 m.
    assert min(seen_s) >= LEAST_HEADINGS
    assert seen_s[-4:] == [8.0, 8.1, 9.0, 9.1]


def test_a_blurred_or_dazzled_camera_is_reported_after_some_seconds_and_until_it_sees() -> None:
    road = RENDERER.draw(Scene(()), np.random.default_rng(1))
    clear, blurred = [road] * 6, [motion_blurred(road)] * 6
    images = [*clear, *blurred, *clear, *([bright(road)] * 6)]
    drive = ((float(at), np.roll(image, at, axis=1)) for at, image in enumerate(images))
    events, _ = watched(drive, CAMERA)

    assert [event.impairments for event in events] == [
        (Impairment.BLURRED,),
        (),
        (Impairment.OVER_EXPOSED,),
    ]
    assert [event.stamp_s for event in events] == [10.0, 13.0, 22.0]


def test_a_picture_in_which_a_plate_is_legible_is_not_blurred() -> None:
    road = motion_blurred(RENDERER.draw(Scene(()), np.random.default_rng(1)))
    drive = [(float(at), np.asarray(np.roll(road, at, axis=1))) for at in range(12)]

    assert watched_by(PictureWatch(LANE_M), iter(drive), CAMERA, legibility=0.95) == ([], 0.0)
    assert watched_by(PictureWatch(LANE_M), iter(drive), CAMERA, legibility=0.5)[0] != []


def test_ranges_in_a_dark_picture_are_less_certain_and_nothing_is_impaired() -> None:
    road = RENDERER.draw(Scene(()), np.random.default_rng(1))
    drives = (
        ((float(at), np.roll(image, at, axis=1)) for at in range(6)) for image in (road, dark(road))
    )

    assert [watched(drive, CAMERA) for drive in drives] == [([], 0.0), ([], DARK_SIGMA)]


@pytest.mark.long
@pytest.mark.realdata
@pytest.mark.parametrize("clip", HEADINGS_RAD)
def test_a_clear_camera_is_not_impaired(clip: str, rig_data: Path) -> None:
    events, _ = of_clip(rig_data, clip, lambda image: image)

    assert events == []


@pytest.mark.long
@pytest.mark.realdata
@pytest.mark.parametrize(
    ("clip", "disturb", "impairment"),
    [
        ("gantries-360p", turned(4.0, 0.0), Impairment.TURNED),
        ("gantries-360p", turned(0.0, -4.0), Impairment.TURNED),
        ("gantries-360p", motion_blurred, Impairment.BLURRED),
        ("empty-lane-540p", motion_blurred, Impairment.BLURRED),
        ("small-leads-320p", motion_blurred, Impairment.BLURRED),
        ("gantries-360p", bright, Impairment.OVER_EXPOSED),
        ("gantries-360p", lambda image: smears(image, 30), Impairment.DIRTY),
    ],
)
def test_an_impaired_camera_is_reported_and_its_ranges_are_less_certain(
    clip: str, disturb: Disturbance, impairment: Impairment, rig_data: Path
) -> None:
    events, sigma = of_clip(rig_data, clip, disturb)

    assert events[0].impairments == (impairment,)
    assert sigma >= RANGE_SIGMA[impairment]
