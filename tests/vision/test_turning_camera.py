"""What is followed while the vehicle turns at a junction or around an obstacle."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from typing_extensions import override

from onboard.observations import Discarded, ImageBox
from onboard.vision.camera_turn import CameraTurn
from onboard.vision.frame_admission import FrameAdmission
from onboard.vision.frames import Image
from onboard.vision.recordings import VideoFile
from onboard.vision.settings import VisionSettings
from onboard.vision.sized_camera import Networks, SizedCameras
from tests.vision.test_crossing_vehicles import (
    CAMERA,
    FOCAL_PX,
    HEIGHT_PX,
    WIDTH_PX,
    Car,
    reports,
)

TURN_RAD_S = 0.5
"""Right at a junction: 5 m/s in a radius of 10 m."""
TURNS_S = 1.0, 3.0
"""From when to when, after 0.5 s in which the turn begins."""


def turned_rad(at_s: float) -> float:
    """Heading to the right of the first, with half a second to begin and to end the turn."""
    since_s = min(max(at_s - TURNS_S[0], 0.0), TURNS_S[1] - TURNS_S[0])
    begin_s = min(since_s, 0.5)
    end_s = min(max(at_s - TURNS_S[1], 0.0), 0.5)
    return TURN_RAD_S * (begin_s**2 + since_s - begin_s + end_s - end_s**2)


BLOB_PX = 40
_BLOBS = np.random.default_rng(3).normal(0.0, 25.0, (HEIGHT_PX // BLOB_PX, 96, 3))
_SKY_TO_ROAD = np.linspace(190.0, 60.0, HEIGHT_PX)[:, None, None]
AROUND = _SKY_TO_ROAD + cv2.resize(_BLOBS, (96 * BLOB_PX, HEIGHT_PX), interpolation=cv2.INTER_CUBIC)


def panorama(rad: float, noise: int = 0) -> Image:
    """What a camera sees that has turned to the right by so much: soft blobs, from sky to road.

    `noise` is the seed of the sensor's.
    """
    columns = (np.arange(WIDTH_PX) + round(rad * FOCAL_PX)) % AROUND.shape[1]
    seen = AROUND[:, columns] + np.random.default_rng(noise).normal(0.0, 4.0, (HEIGHT_PX, 1, 3))
    return np.asarray(np.clip(seen, 0, 255), np.uint8)


def on_the_turn(at_s: float) -> Image:
    return panorama(turned_rad(at_s), noise=round(at_s * 1000))


@dataclass(frozen=True)
class SeenFromTurning(Car):
    """A car of which place and speed are as at first, when the camera has not turned."""

    @override
    def place(self, at_s: float) -> tuple[float, float]:
        ahead_m, right_m = super().place(at_s)
        cos, sin = math.cos(turned_rad(at_s)), math.sin(turned_rad(at_s))
        return cos * ahead_m + sin * right_m, cos * right_m - sin * ahead_m


def turn_rates(*frames: tuple[float, Image]) -> list[tuple[float, float]]:
    """Stamp and turn rate at each frame."""
    cameras = SizedCameras(CAMERA, VisionSettings(tag_dictionary=None, plates=False), Networks())
    return _turn_rates(cameras, frames)


def test_a_turn_rate_is_measured_from_the_picture() -> None:
    frames = [(index / 15, panorama(0.4 * index / 15)) for index in range(30)]

    rates = turn_rates(*frames)

    assert rates[-1][1] == pytest.approx(0.4, rel=0.03)


def test_a_camera_that_looks_straight_ahead_does_not_turn() -> None:
    rates = turn_rates(*((index / 15, panorama(0.0, noise=index)) for index in range(30)))

    assert max(abs(rate) for _, rate in rates) < 0.05


def test_pictures_without_anything_in_common_tell_no_turn() -> None:
    frames = [(index / 15, panorama(1.3 * index)) for index in range(20)]

    assert max(abs(rate) for _, rate in turn_rates(*frames)) < 0.1


def test_torn_pictures_tell_no_turn() -> None:
    images = [panorama(0.0, noise=index) for index in range(20)]
    for index in range(5, 20, 3):
        images[index] = np.roll(images[index], 37 * index, axis=1)

    rates = turn_rates(*((index / 15, image) for index, image in enumerate(images)))

    assert max(abs(rate) for _, rate in rates) < 0.05


def test_a_turn_of_which_no_picture_tells_any_more_is_over() -> None:
    """As in rain on the windscreen: tracks were moved across with it for as long as that lasted."""
    frames = [(index / 15, panorama(0.4 * index / 15)) for index in range(25)]
    rng = np.random.default_rng(4)
    for _, image in frames[15:]:
        image[: HEIGHT_PX * 3 // 4] = rng.integers(90, 170, (HEIGHT_PX * 3 // 4, WIDTH_PX, 3))

    rates = [rate for _, rate in turn_rates(*frames)]

    assert rates[15] == rates[14] > 0.3, "one picture that tells nothing ends no turn"
    assert rates[-1] == 0.0


def test_a_picture_after_a_pause_tells_no_turn() -> None:
    rates = turn_rates((0.0, panorama(0.0)), (1.0, panorama(0.1)))

    assert rates[-1][1] == 0.0


@pytest.mark.parametrize("pitch_rad", [-0.5, 0.5], ids=["to the sky", "to the road"])
def test_a_camera_that_does_not_show_the_horizon_tells_no_turn(pitch_rad: float) -> None:
    camera = CAMERA.model_copy(update={"pitch_rad": pitch_rad})
    settings = VisionSettings(tag_dictionary=None, plates=False)
    frames = ((index / 15, panorama(0.4 * index / 15)) for index in range(5))

    rates = _turn_rates(SizedCameras(camera, settings, Networks()), frames)

    assert [rate for _, rate in rates] == [0.0] * 5


@pytest.mark.parametrize(("ahead_m", "right_m"), [(12.0, 1.0), (20.0, 3.5), (20.0, 12.0)])
def test_a_parked_car_is_one_track_while_the_vehicle_turns(ahead_m: float, right_m: float) -> None:
    car = SeenFromTurning(ahead_m, right_m, is_across=False)

    seen = reports(4.0, car, picture=on_the_turn)

    assert len({each.track_id for each in seen}) == 1
    assert len(seen) >= 4


def test_a_lead_that_goes_along_in_the_turn_stays_one_track() -> None:
    lead = Car(9.0, 0.0, is_across=False)
    box = lead.box(0.0, np.random.default_rng(1))
    assert box is not None
    rows, columns = (slice(round(a), round(b)) for a, b in _sides(box))
    rear = np.random.default_rng(2).integers(0, 200, (7, 11, 3), np.uint8)

    def followed(at_s: float) -> Image:
        image = on_the_turn(at_s)
        size = columns.stop - columns.start, rows.stop - rows.start
        image[rows, columns] = cv2.resize(rear, size, interpolation=cv2.INTER_CUBIC)
        return image

    seen = reports(4.0, lead, picture=followed)

    assert len({each.track_id for each in seen}) == 1
    assert len(seen) >= 8


def _sides(box: ImageBox) -> tuple[tuple[float, float], tuple[float, float]]:
    """From row to row, and from column to column."""
    return (box.y_px, box.y_px + box.h_px), (box.x_px, box.x_px + box.w_px)


def _turn_rates(
    cameras: SizedCameras, frames: Iterable[tuple[float, Image]]
) -> list[tuple[float, float]]:
    admission, turn, rates = FrameAdmission(cameras), CameraTurn(), []
    for stamp_s, image in frames:
        frame = admission.admit(image, stamp_s)
        if isinstance(frame, Discarded) or frame.is_repeat:
            continue
        turn.receive_frame(frame)
        rates.append((stamp_s, turn.rate_rad_s))
    return rates


@pytest.mark.realdata
@pytest.mark.long
@pytest.mark.parametrize(
    ("clip", "turns"),
    [
        ("barrier-shadow", [(7.9, 0.2, 0.6), (9.1, -0.4, -0.2)]),  # around a slow car, and back
        ("night-street", [(8.6, -0.7, -0.3), (2.0, -0.1, 0.1)]),
        ("motorway-720p", [(1.0, -0.1, 0.1)]),
    ],
)
def test_turns_of_recorded_drives_are_seen(
    rig_data: Path, clip: str, turns: list[tuple[float, float, float]]
) -> None:
    cameras = SizedCameras(None, VisionSettings(tag_dictionary=None, plates=False), Networks())
    video = VideoFile(str(rig_data / "clips" / f"{clip}.mp4"), None)

    rates = dict(_turn_rates(cameras, ((each.stamp_s, each.image) for each in video)))

    for at_s, least, most in turns:
        nearest = min(rates, key=lambda stamp_s: abs(stamp_s - at_s))
        assert least < rates[nearest] < most
