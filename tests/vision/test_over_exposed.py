"""A camera with too much light: a white road is no free lane, and soon the camera is none."""

from pathlib import Path

import numpy as np
import pytest

from onboard.observations import Lead, LeadIdentity
from onboard.vision.frame_check import OVER_EXPOSED_FRAMES, FrameCheck, FrameFault
from onboard.vision.frames import Image
from onboard.vision.networks import load_perception
from onboard.vision.recordings import VideoFile
from onboard.vision.settings import Calibration, VisionSettings, guessed_calibration

FRAMES = 60


def road(seed: int, white: float) -> Image:
    """A picture whose lower half is white from the left on, up to a share of its width."""
    image = np.random.default_rng(seed).integers(60, 160, (240, 320, 3), np.uint8)
    image[120:, : round(white * 320)] = 255
    return image


def test_a_picture_whose_road_is_white_may_hide_vehicles() -> None:
    check = FrameCheck()

    assert not check.check(road(1, 0.1)).may_hide_vehicles
    assert check.check(road(2, 0.4)).may_hide_vehicles


def test_a_camera_is_discarded_as_over_exposed_after_a_while_and_not_in_a_moment() -> None:
    check = FrameCheck()
    faults = [check.check(road(seed, 0.8)).fault for seed in range(OVER_EXPOSED_FRAMES + 2)]

    assert faults == [None] * OVER_EXPOSED_FRAMES + [FrameFault.OVER_EXPOSED] * 2
    assert check.check(road(1000, 0.5)).fault is None
    assert check.check(road(1001, 0.8)).fault is None


@pytest.mark.long
@pytest.mark.realdata
def test_with_vehicles_that_too_much_light_hides_no_lane_is_reported_free(rig_data: Path) -> None:
    """On a dense motorway, with four times the light: 239 of 260 frames were a free lane."""
    video = VideoFile(str(rig_data / "clips" / "gantries-360p.mp4"), None)
    perception, identities = None, set()
    for frame in (each for index, each in enumerate(video) if index < 2 * FRAMES and index % 2):
        height_px, width_px = frame.image.shape[:2]
        perception = perception or load_perception(
            calibrated(guessed_calibration(width_px, height_px)), VisionSettings()
        )
        light = np.clip(4.0 * frame.image.astype(np.float32) + 20.0, 0, 255)
        perception.receive_frame(light.astype(np.uint8), frame.stamp_s)
        while (event := perception.next_event()) is not None:
            identities |= {event.identity} if isinstance(event, Lead) else set()

    assert identities == {LeadIdentity.UNKNOWN}


def calibrated(lens: Calibration) -> Calibration:
    """The same, with a mounting: only such a camera tells that a lane is free."""
    return Calibration(**(lens.model_dump() | {"pitch_rad": 0.0}))
