"""The blue band of a European plate is part of it, and blue bodywork is not."""

import cv2
import numpy as np
import pytest

from onboard.vision.blue_band import BAND, include_blue_band

BODY, BLUE, WHITE = (60, 60, 70), (150, 70, 20), (225, 225, 225)
LEFT, TOP, WIDTH, HEIGHT = 100, 100, 208, 44


def plate(
    body: tuple[int, int, int] = BODY, band: tuple[int, int, int] | None = BLUE
) -> np.ndarray:
    image = np.full((240, 400, 3), body, np.uint8)
    right, bottom = LEFT + WIDTH - 1, TOP + HEIGHT - 1
    cv2.rectangle(image, (LEFT, TOP), (right, bottom), WHITE, cv2.FILLED)
    if band is not None:
        band_right = LEFT + round(BAND * WIDTH) - 1
        cv2.rectangle(image, (LEFT, TOP), (band_right, bottom), band, cv2.FILLED)
    return image


def corners(left: float) -> np.ndarray:
    right, bottom = LEFT + WIDTH, TOP + HEIGHT
    return np.array([(left, TOP), (right, TOP), (right, bottom), (left, bottom)], np.float32)


WITHOUT_BAND = corners(LEFT + BAND * WIDTH)


@pytest.mark.parametrize(
    "body", [BODY, (20, 20, 20), (230, 230, 230), (40, 40, 180), (40, 160, 60)]
)
def test_corners_move_out_to_a_band_that_was_left_out(body: tuple[int, int, int]) -> None:
    found = include_blue_band(plate(body), WITHOUT_BAND)

    assert found == pytest.approx(corners(LEFT), abs=1.0)


def test_corners_that_include_the_band_stay() -> None:
    assert include_blue_band(plate(), corners(LEFT)) == pytest.approx(corners(LEFT))


def test_corners_of_a_plate_without_a_band_stay() -> None:
    assert include_blue_band(plate(band=None), corners(LEFT)) == pytest.approx(corners(LEFT))


def test_no_band_is_found_on_a_blue_car() -> None:
    assert include_blue_band(plate(body=BLUE, band=None), corners(LEFT)) == pytest.approx(
        corners(LEFT)
    )


@pytest.mark.parametrize("shift", [(-150, -150), (250, 150), (-400, 0)])
def test_corners_at_and_beyond_the_border_raise_nothing(shift: tuple[int, int]) -> None:
    assert include_blue_band(plate(), corners(LEFT) + np.array(shift, np.float32)).shape == (4, 2)


@pytest.mark.parametrize("share", [-0.03, 0.02, 0.045, 0.07])
@pytest.mark.parametrize(
    "body",
    [
        *((20, 20, 20), (230, 230, 230), (40, 40, 180)),
        *((120, 90, 60), (214, 209, 32), (216, 34, 53)),  # blue ones
    ],
)
def test_the_plate_begins_at_the_outer_edge_of_the_band(
    share: float, body: tuple[int, int, int]
) -> None:
    """The detector may cut the band in two or include bodywork, and the bodywork may be blue."""
    found = include_blue_band(plate(body), corners(LEFT + share * WIDTH))

    assert found == pytest.approx(corners(LEFT), abs=1.5)


def test_a_blue_car_around_a_white_border_is_no_band() -> None:
    image = plate(body=BLUE, band=None)

    assert include_blue_band(image, corners(LEFT + 5.0)) == pytest.approx(corners(LEFT + 5.0))
