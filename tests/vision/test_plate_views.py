"""The mean of a plate's views: less noise, and only of views that show one plate."""

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from onboard.vision.plate_views import BLUR_PX, MAX_FRAMES, PlateViews


def plate(seed: int) -> npt.NDArray[np.float32]:
    """Views of one plate without noise."""
    coarse = np.random.default_rng(seed).standard_normal((8, 20))
    return np.tile(np.kron(coarse, np.ones((8, 8))), (3, 1, 1, 1)).astype(np.float32)


def noise(rng: np.random.Generator) -> npt.NDArray[np.float32]:
    return (0.5 * rng.standard_normal((3, 1, 64, 160))).astype(np.float32)


def test_the_mean_has_less_noise_than_a_view() -> None:
    rng = np.random.default_rng(1)
    views = PlateViews(plate(1) + noise(rng))
    for _ in range(3):
        views = views.with_views(plate(1) + noise(rng))

    assert views.frames == 4
    assert (views.mean - plate(1)).std() == pytest.approx(0.25, abs=0.02)


def moved(views: np.ndarray, right_px: float, larger: float = 1.0) -> np.ndarray:
    """The views as corners that are off show them."""
    matrix = np.array([(larger, 0.0, right_px), (0.0, larger, 0.0)])
    warped = [
        cv2.warpAffine(v, matrix, (160, 64), borderMode=cv2.BORDER_REFLECT) for v in views[:, 0]
    ]
    return np.stack(warped)[:, None]


def soft(seed: int) -> np.ndarray:
    """Views of a plate whose pixels are as large as eight of a view."""
    return np.stack([cv2.GaussianBlur(view, (0, 0), 3.0) for view in plate(seed)[:, 0]])[:, None]


def correlation(one: np.ndarray, other: np.ndarray) -> float:
    """Away from the rim, which moved views do not show."""
    inner = np.s_[:, :, 8:-8, 16:-16]
    return float(np.corrcoef(one[inner].ravel(), other[inner].ravel())[0, 1])


def test_views_with_other_corners_are_aligned() -> None:
    rng = np.random.default_rng(1)
    views = PlateViews(soft(1))
    for _ in range(11):
        views = views.with_views(moved(soft(1), rng.uniform(-6.0, 6.0), rng.uniform(0.96, 1.04)))

    assert views.frames == 12
    assert views.mean.std() > 0.95 * soft(1).std()


def test_the_mean_has_the_mean_corners_and_not_those_of_the_first_frame() -> None:
    views = PlateViews(moved(soft(1), 3.0))
    for index in range(1, 12):
        views = views.with_views(moved(soft(1), -3.0 if index % 2 else 3.0))

    assert correlation(views.mean, soft(1)) > 0.97
    assert correlation(views.mean, moved(soft(1), 3.0)) < 0.9


def test_old_views_fade() -> None:
    views = PlateViews(plate(1))
    for _ in range(100):
        views = views.with_views(np.float32(1.1) * plate(1))

    assert views.frames == MAX_FRAMES
    assert np.allclose(views.mean, 1.1 * plate(1), atol=1e-3)


def test_another_plate_begins_a_mean_of_its_own() -> None:
    views = PlateViews(plate(1)).with_views(plate(1)).with_views(plate(2))

    assert views.frames == 1
    assert np.array_equal(views.mean, plate(2))


def test_uniform_views_raise_nothing() -> None:
    blank = np.zeros((3, 1, 64, 160), np.float32)

    assert PlateViews(blank).with_views(blank).frames == 1


def test_what_frames_show_blurred_is_sharpened_as_noise_falls() -> None:
    rng = np.random.default_rng(1)
    px_per_pixel = 6.0
    sigma = BLUR_PX * px_per_pixel
    blurred = np.stack([cv2.GaussianBlur(view, (0, 0), sigma) for view in plate(1)[:, 0]])[:, None]

    def seen() -> npt.NDArray[np.float32]:
        return np.asarray(blurred + 0.2 * noise(rng), np.float32)

    one = views = PlateViews(seen())
    for _ in range(11):
        views = views.with_views(seen())

    def error(mean: np.ndarray) -> float:
        return float(np.std(mean / mean.std() - plate(1) / plate(1).std()))

    assert np.array_equal(one.sharpened(px_per_pixel), one.mean)
    assert error(views.sharpened(px_per_pixel)) < 0.9 * error(views.mean)


def test_what_is_sharp_is_read_as_it_is_seen() -> None:
    sharp, blurred = (PlateViews(views, 12.0) for views in (plate(1), soft(1)))

    assert np.array_equal(sharp.sharpened(2.0), sharp.mean)
    assert not np.array_equal(blurred.sharpened(2.0), blurred.mean)


def test_uniform_views_stay_uniform() -> None:
    blank = np.zeros((3, 1, 64, 160), np.float32)

    assert not PlateViews(blank, 2.0).sharpened(6.0).any()
