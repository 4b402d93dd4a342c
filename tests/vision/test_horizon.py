"""A picture whose horizon is not sharp hides vehicles: behind dirt and blur, no lane is free."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from onboard.observations import Lead, LeadIdentity
from onboard.vision.frames import Image
from onboard.vision.horizon import Horizon
from onboard.vision.lane import HostLane
from onboard.vision.networks import load_networks
from onboard.vision.perception import Perception
from onboard.vision.perspective import Perspective, RoadPosition
from onboard.vision.recordings import VideoFile
from onboard.vision.settings import VisionSettings, guessed_calibration
from sim_rig.rendering.scene import Scene
from tests.vision.drive import CAMERA, RENDERER
from tests.vision.test_over_exposed import calibrated

LANE_M = 3.5
HORIZON = Horizon(Perspective(CAMERA), LANE_M)
LANE = HostLane(LANE_M).shape
MUD_BGR = (60, 75, 85)
FRAMES = 20


def road() -> Image:
    return RENDERER.draw(Scene(()), np.random.default_rng(1))


def behind(image: Image, cover: np.ndarray) -> Image:
    """The image behind dirt, which is out of focus; `cover` (h, w) is its density, 0 to 1."""
    width_px = image.shape[1]
    density = cv2.GaussianBlur(cover, (0, 0), 0.012 * width_px)[..., None]
    soft = cv2.GaussianBlur(image, (0, 0), 0.02 * width_px).astype(np.float32)
    dirt = 0.5 * soft + 0.5 * np.asarray(MUD_BGR, np.float32)
    return np.asarray(image * (1 - density) + dirt * density, np.uint8)


def smears(image: Image, count: int) -> Image:
    """The image behind so many round smears."""
    height_px, width_px = image.shape[:2]
    rng, cover = np.random.default_rng(1), np.zeros((height_px, width_px), np.float32)
    for _ in range(count):
        middle = rng.uniform(0, width_px), rng.uniform(0.3 * height_px, 0.95 * height_px)
        radius_px = round(rng.uniform(0.03, 0.09) * width_px)
        cv2.circle(cover, (int(middle[0]), int(middle[1])), radius_px, 0.9, cv2.FILLED)
    return behind(image, cover)


def one_smear(image: Image, right_m: float) -> Image:
    """The image behind a smear on the horizon, so far beside the lane's middle at 30 m."""
    x_px, _ = Perspective(CAMERA).project(RoadPosition(30.0, right_m, 0.0))
    _, y_px = Perspective(CAMERA).project(RoadPosition(1e6, 0.0, 0.0))
    cover = np.zeros(image.shape[:2], np.float32)
    cv2.circle(cover, (round(x_px), round(y_px)), 70, 0.9, cv2.FILLED)
    return behind(image, cover)


def blurred(image: Image) -> Image:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 4.0), np.uint8)


@pytest.mark.parametrize("light", [1.0, 0.5, 0.25])
def test_a_clear_road_is_sharp_in_any_light(light: float) -> None:
    assert HORIZON.is_sharp(np.asarray(road() * light, np.uint8), LANE)


def test_a_blurred_road_is_not() -> None:
    assert not HORIZON.is_sharp(blurred(road()), LANE)


def test_a_smear_hides_vehicles_only_where_they_would_be() -> None:
    assert not HORIZON.is_sharp(one_smear(road(), 0.0), LANE)
    assert HORIZON.is_sharp(one_smear(road(), 12.0), LANE)


@pytest.mark.parametrize("side_px", [1, 8, 64])
def test_a_picture_too_small_to_show_anything_is_not_sharp(side_px: int) -> None:
    assert not HORIZON.is_sharp(np.zeros((side_px, side_px, 3), np.uint8), LANE)


@pytest.mark.long
@pytest.mark.realdata
@pytest.mark.parametrize("clip", ["gantries-360p", "motorway-720p", "empty-lane-540p"])
@pytest.mark.parametrize("fault", ["thirty smears", "blur"])
def test_in_a_clip_behind_dirt_or_blurred_no_lane_is_free(
    clip: str, fault: str, rig_data: Path
) -> None:
    """Behind thirty smears, a dense motorway was free in 106 of 129 frames."""
    video = VideoFile(str(rig_data / "clips" / f"{clip}.mp4"), None)
    perception, identities = None, set()
    for frame in (each for index, each in enumerate(video) if index < FRAMES and index % 2):
        image = smears(frame.image, 30) if fault == "thirty smears" else blurred(frame.image)
        height_px, width_px = image.shape[:2]
        perception = perception or Perception(
            calibrated(guessed_calibration(width_px, height_px)),
            VisionSettings(),
            load_networks(VisionSettings()),
        )
        perception.receive_frame(image, frame.stamp_s)
        while (event := perception.next_event()) is not None:
            identities |= {event.identity} if isinstance(event, Lead) else set()

    assert LeadIdentity.UNKNOWN in identities
    assert LeadIdentity.NO_LEAD not in identities
