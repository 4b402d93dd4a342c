"""Which frames the later steps of perception get, and why the others are discarded."""

import numpy as np
import pytest

from onboard.observations import Discarded
from onboard.vision.frame_admission import AdmittedFrame, FrameAdmission
from onboard.vision.settings import Calibration, VisionSettings
from onboard.vision.sized_camera import Networks, SizedCameras

CALIBRATION = Calibration(width_px=640, height_px=480, focal_x_px=550.0, focal_y_px=550.0,
                          principal_x_px=320.0, principal_y_px=240.0)  # fmt: skip


def admission(calibration: Calibration | None = None) -> FrameAdmission:
    return FrameAdmission(SizedCameras(calibration, VisionSettings(), Networks()))


def image(seed: int, width_px: int = 640, height_px: int = 480) -> np.ndarray:
    """A picture with contrast, that no other seed gives."""
    coarse = np.random.default_rng(seed).integers(0, 255, (12, 16, 3), np.uint8)
    rows, columns = (
        np.arange(side) * part // side for side, part in ((height_px, 12), (width_px, 16))
    )
    return coarse[rows][:, columns]


def test_a_frame_is_admitted_with_the_camera_of_its_size() -> None:
    frame = admission(CALIBRATION).admit(image(1, 320, 240), 1.0)

    assert isinstance(frame, AdmittedFrame)
    assert frame.camera.size_px == (320, 240)
    assert frame.camera.perspective.width_px(1.0, 1.0) == 275.0


def test_frames_of_one_size_have_one_camera_and_another_size_has_its_own() -> None:
    gate = admission(CALIBRATION)
    frames = [gate.admit(image(n, *size), float(n)) for n, size in
              enumerate([(640, 480), (640, 480), (320, 240)])]  # fmt: skip

    first, second, other = (f.camera for f in frames if isinstance(f, AdmittedFrame))
    assert first is second
    assert other is not first


@pytest.mark.parametrize(
    ("size", "detail"),
    [
        ((640, 360), "640 x 360 px, calibrated for 640 x 480"),
        ((40, 30), "40 x 30 px, calibrated for 640 x 480"),
        ((9600, 72), "9600 x 72 px, calibrated for 640 x 480"),
    ],
)
def test_a_size_that_the_calibration_does_not_allow_is_named(
    size: tuple[int, int], detail: str
) -> None:
    assert admission(CALIBRATION).admit(image(1, *size), 1.0) == Discarded(
        1.0, "vision", "frame_size", detail
    )


def test_a_frame_that_is_not_after_the_last_admitted_one_is_discarded() -> None:
    gate = admission()
    gate.admit(image(1), 2.0)
    gate.admit(np.zeros((480, 640, 3), np.uint8), 9.0)  # blank: its stamp does not count

    assert gate.admit(image(2), 2.0) == Discarded(2.0, "vision", "old_frame", "not after 2.000 s")
    assert isinstance(gate.admit(image(3), 2.1), AdmittedFrame)


def test_the_next_drive_may_begin_earlier_and_its_first_frame_repeats_nothing() -> None:
    gate = admission()
    gate.admit(image(1), 2.0)
    gate.reset()

    frame = gate.admit(image(1), 0.0)

    assert isinstance(frame, AdmittedFrame)
    assert not frame.is_repeat
