"""Frames go through perception, and some of them to the black box."""

import cv2
import numpy as np

from onboard.observations import Discarded
from onboard.vision.frame_observer import FrameObserver
from onboard.vision.frames import NO_IMAGE
from onboard.vision.networks import load_perception
from onboard.vision.seen import PictureRate
from sim_rig.rendering.scene import Scene
from tests.vision.drive import CAMERA, TAGS, frames


def observer(hz: float) -> FrameObserver:
    return FrameObserver(load_perception(CAMERA, TAGS), PictureRate(hz, quality=60))


def test_frames_are_recorded_at_the_configured_rate_as_jpeg() -> None:
    it = observer(hz=2.0)

    seen = [it.receive_frame(image, at_s) for at_s, image in frames(lambda _: Scene(), 1.2)]

    pictures = [each.picture for each in seen if each.picture is not None]
    assert [round(picture.stamp_s, 1) for picture in pictures] == [0.0, 0.5, 1.0]
    decoded = cv2.imdecode(np.frombuffer(pictures[0].jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    assert decoded.shape == (CAMERA.height_px, CAMERA.width_px, 3)


def test_a_frame_that_did_not_decode_is_discarded_and_not_recorded() -> None:
    """Encoding it ended the camera's thread: the camera was lost for the rest of the drive."""
    seen = observer(hz=2.0).receive_frame(NO_IMAGE, 1.0)

    assert seen.picture is None
    assert [type(event) for event in seen.events] == [Discarded]
