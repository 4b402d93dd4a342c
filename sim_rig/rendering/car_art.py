"""A car from behind, as a texture with transparency: body, window, lights, bumper, wheels."""

from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

Texture = npt.NDArray[np.uint8]
"""(h, w, 4), BGRA."""
WIDTH_PX = 512
PLATE_CENTRE = (0.5, 0.58)
"""Centre of a plate, as shares of the car's width and of its height from the top."""

_GLASS = (62, 54, 46)
_RUBBER = (24, 24, 24)


OPAQUE = 0.19, 0.05, 0.81, 0.92
"""Left, top, right and bottom of a box where all rears are opaque, in shares of their size."""


@lru_cache(maxsize=64)
def rear_of_car(
    width_m: float, height_m: float, bgr: tuple[int, int, int], braking: bool
) -> Texture:
    """Draw the rear of a car, `WIDTH_PX` wide. Callers must not write to it.

    Args:
        width_m: width of the car.
        height_m: height of the car; sets the height of the texture.
        bgr: colour of the body.
        braking: whether the brake lamps are on.
    """
    width, height = WIDTH_PX, round(WIDTH_PX * height_m / width_m)
    rear = np.zeros((height, width, 4), np.uint8)

    def at(*points: tuple[float, float]) -> npt.NDArray[np.int32]:
        return np.asarray([(x * width, y * height) for x, y in points], np.int32)

    def fill(shape: npt.NDArray[np.int32], colour: tuple[int, int, int]) -> None:
        cv2.fillPoly(rear, [shape], (*colour, 255), cv2.LINE_AA)

    def shade(factor: float) -> tuple[int, int, int]:
        blue, green, red = (min(255, round(channel * factor)) for channel in bgr)
        return blue, green, red

    for left in (0.04, 0.80):
        fill(at((left, 0.72), (left + 0.16, 0.72), (left + 0.16, 1.0), (left, 1.0)), _RUBBER)
    fill(at((0.17, 0.03), (0.83, 0.03), (0.95, 0.38), (0.05, 0.38)), shade(0.85))
    fill(at((0.21, 0.08), (0.79, 0.08), (0.87, 0.36), (0.13, 0.36)), _GLASS)
    fill(at((0.03, 0.38), (0.97, 0.38), (1.0, 0.56), (0.99, 0.86), (0.01, 0.86), (0.0, 0.56)), bgr)
    fill(at((0.03, 0.38), (0.97, 0.38), (0.98, 0.43), (0.02, 0.43)), shade(1.15))
    fill(at((0.01, 0.70), (0.99, 0.70), (0.98, 0.90), (0.02, 0.90)), shade(0.7))
    fill(at((0.08, 0.86), (0.92, 0.86), (0.90, 0.93), (0.10, 0.93)), (38, 38, 38))
    lamp = (90, 90, 255) if braking else (30, 25, 130)
    for inner, outer in ((0.20, 0.02), (0.80, 0.98)):
        fill(at((inner, 0.42), (outer, 0.42), (outer, 0.57), (inner, 0.54)), lamp)
    if braking:
        fill(at((0.40, 0.045), (0.60, 0.045), (0.60, 0.07), (0.40, 0.07)), lamp)
    return rear
