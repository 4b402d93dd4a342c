"""Repeats of one image: tolerated for a moment, then a lost camera until an image is new."""

import math

from onboard.observations import Sensor, SensorLost, SensorRecovered
from onboard.vision.frozen_camera import FrozenCamera

AFTER_S = 0.6


def test_a_camera_that_repeats_one_image_is_lost_once_and_comes_back_with_a_new_one() -> None:
    camera = FrozenCamera(AFTER_S)
    camera.receive_new_image(10.0)

    assert camera.receive_repeat(10.5) == []
    assert not camera.is_lost(10.5)
    assert camera.receive_repeat(11.0) == [SensorLost(11.0, Sensor.CAMERA, 1.0, "frozen")]
    assert camera.is_lost(11.5)
    assert camera.receive_repeat(11.5) == []
    assert camera.receive_new_image(12.0) == [SensorRecovered(12.0, Sensor.CAMERA)]
    assert not camera.is_lost(12.5)


def test_before_its_first_image_a_camera_was_silent_for_ever() -> None:
    assert FrozenCamera(AFTER_S).silent_s(3.0) == math.inf
