"""The ends of a plate, on rectangles and plates of known width."""

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from onboard.vision.plate_ends import refine_ends

TRUE = np.asarray([(60.25, 40.0), (140.75, 40.0), (140.75, 62.0), (60.25, 62.0)], np.float32)


def plate_image(ground: int, body: int, ink: int | None = None) -> npt.NDArray[np.uint8]:
    """A plate at `TRUE`, drawn eight times as large and averaged, with three upright strokes."""
    large = np.full((100 * 8, 200 * 8, 3), body, np.uint8)
    corners = np.rint(TRUE * 8).astype(int)
    cv2.rectangle(large, corners[0].tolist(), (corners[2] - 1).tolist(), (ground,) * 3, cv2.FILLED)
    for x in (70, 100, 127) if ink is not None else ():
        cv2.rectangle(large, (x * 8, 44 * 8), (x * 8 + 20, 58 * 8), (ink or 0,) * 3, cv2.FILLED)
    small = cv2.resize(large, (200, 100), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(small, (0, 0), 0.8), np.uint8)


@pytest.mark.parametrize(("ground", "body"), [(220, 60), (60, 220), (150, 100)])
@pytest.mark.parametrize("shift_px", [(-2.0, 1.5), (2.5, -2.0), (0.0, 0.0)])
def test_ends_are_found_to_a_fifth_of_a_pixel(
    ground: int, body: int, shift_px: tuple[float, float]
) -> None:
    left_px, right_px = shift_px
    off = TRUE + np.asarray([(left_px, 0), (right_px, 0), (right_px, 0), (left_px, 0)], np.float32)

    refined = refine_ends(plate_image(ground, body, ink=20), off)

    assert refined == pytest.approx(TRUE, abs=0.2)


def test_a_plate_on_bodywork_of_its_own_colour_stays() -> None:
    assert refine_ends(plate_image(150, 150), TRUE) == pytest.approx(TRUE)


def test_a_leaning_plate_is_moved_along_its_own_direction() -> None:
    turn = cv2.getRotationMatrix2D((100.0, 51.0), 8.0, 1.0)
    image = cv2.warpAffine(plate_image(220, 60), turn, (200, 100), borderMode=cv2.BORDER_REPLICATE)
    truth = (TRUE - 0.5) @ turn[:, :2].T.astype(np.float32) + turn[:, 2].astype(np.float32) + 0.5
    along = (truth[1] - truth[0]) / np.hypot(*(truth[1] - truth[0]))
    off = truth + np.float32(2.0) * along * np.asarray([[1], [-1], [-1], [1]], np.float32)

    refined = refine_ends(np.asarray(image, np.uint8), off)

    assert refined == pytest.approx(truth, abs=0.25)


@pytest.mark.parametrize("shift_px", [(-100, 0), (150, 0), (0, -60), (500, 500)])
def test_corners_at_and_beyond_the_border_raise_nothing(shift_px: tuple[int, int]) -> None:
    off = TRUE + np.asarray(shift_px, np.float32)

    assert np.isfinite(refine_ends(plate_image(220, 60), off)).all()


def test_coincident_corners_stay() -> None:
    point = np.full((4, 2), 50.0, np.float32)

    assert np.array_equal(refine_ends(plate_image(220, 60), point), point)
