"""Training scenes of the detector, and the augmentation of scenes and corners."""

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from training.detector_scenes import mirrored, moved, render_scenes


def test_the_same_seed_gives_the_same_scenes() -> None:
    scenes, corners = render_scenes(4, np.random.default_rng(4))
    again, corners_again = render_scenes(4, np.random.default_rng(4))

    assert np.array_equal(scenes, again)
    assert np.array_equal(corners, corners_again, equal_nan=True)


def board() -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """A white board on black, and its corners, counted from the outer corner of the first pixel."""
    scene = np.zeros((192, 256), np.uint8)
    scene[80:100, 60:110] = 255
    corners = np.full((1, 2, 4, 2), np.nan, np.float32)
    corners[0, 0] = [(60, 80), (110, 80), (110, 100), (60, 100)]
    return scene[None], corners


def middle_of_light(scene: npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    """The middle of the bright pixels, counted like corners."""
    moments = cv2.moments(scene)
    return np.asarray([moments["m10"], moments["m01"]]) / moments["m00"] + 0.5


@pytest.mark.parametrize("seed", range(12))
def test_corners_move_with_the_augmented_scene(seed: int) -> None:
    rng = np.random.default_rng(seed)

    scenes, corners = mirrored(*moved(*board(), rng), rng)

    plate = corners[0, 0]
    assert plate.mean(axis=0) == pytest.approx(middle_of_light(scenes[0]), abs=0.25)
    area_px = float(scenes[0].sum(dtype=np.float64)) / 255
    assert np.prod(np.ptp(plate, axis=0)) == pytest.approx(area_px, rel=0.02)
    assert plate[0, 0] < plate[1, 0], "the first corner is the left one, mirrored or not"
    assert np.isnan(corners[0, 1]).all()


def test_some_plates_are_scaled_as_for_refining() -> None:
    scenes, corners = board()
    many = moved(scenes.repeat(80, axis=0), corners.repeat(80, axis=0), np.random.default_rng(1))[1]

    widths_px = np.ptp(many[:, 0, :, 0], axis=1)

    assert 0.3 < np.mean(widths_px > 67) < 0.7
    assert widths_px.max() < 120
