"""Where the host vehicle heads in the picture: there all that stands still comes from.

While a camera moves without turning, each point of a scene moves in the image away from one point,
the focus of expansion (Longuet-Higgins and Prazdny 1980, "The interpretation of a moving retinal
image"). Bends and other vehicles shift it for a while.
"""

import cv2
import numpy as np
import numpy.typing as npt

MOST_CORNERS, LEAST_CORNERS = 150, 20
CORNER_QUALITY, MIN_APART_PX = 0.01, 8.0
"""Quality of a corner relative to the sharpest, and distance between corners."""
MOST_ERROR_PX, LEAST_MOTION_PX = 0.5, 0.7
"""Distance by which a corner may miss its place when it is followed back, and motion below which
its direction is not known."""
OFF_ANGLE, MOST_OFF_ANGLE = 0.1, 0.15
"""Sine of the angle between a motion and the line from the focus, at which it counts a quarter, and
up to which it agrees."""
LEAST_AGREEING = 0.6
"""Share of the corners that must agree: in a bend, or beside other vehicles, fewer do."""
_RIM = 1 / 8
"""Share of the height at top and bottom that is ignored: cameras write the time there."""
_STEPS, _NEAR_PX = 15, 20.0
_LARGEST_CONDITION = 1e4

_Points = npt.NDArray[np.float64]
"""(n, 2), in pixels."""


def focus_of_expansion(
    before: npt.NDArray[np.uint8], now: npt.NDArray[np.uint8]
) -> tuple[float, float] | None:
    """Focus of two successive pictures in pixels; `None` if the motion has none.

    Args:
        before: (h, w), grey.
        now: of the same size.
    """
    rim = round(_RIM * len(before))
    places, motions = _motions(before[rim : len(before) - rim], now[rim : len(now) - rim])
    start = np.array([before.shape[1] / 2, len(before) / 2 - rim])
    focus = _common_origin(places, motions, start) if len(places) >= LEAST_CORNERS else None
    return None if focus is None else (float(focus[0]), float(focus[1]) + rim)


def _motions(before: npt.NDArray[np.uint8], now: npt.NDArray[np.uint8]) -> tuple[_Points, _Points]:
    """Places and motions of the corners that move and are followed there and back."""
    corners = cv2.goodFeaturesToTrack(before, MOST_CORNERS, CORNER_QUALITY, MIN_APART_PX)
    if corners is None:
        return np.zeros((0, 2)), np.zeros((0, 2))
    moved, found, _ = cv2.calcOpticalFlowPyrLK(before, now, corners, corners.copy())
    back, found_back, _ = cv2.calcOpticalFlowPyrLK(now, before, moved, moved.copy())
    error_px = np.abs(back - corners).reshape(-1, 2).max(axis=1)
    motions = np.asarray(moved - corners, np.float64).reshape(-1, 2)
    sound = (found.ravel() == 1) & (found_back.ravel() == 1) & (error_px <= MOST_ERROR_PX)
    sound &= np.hypot(motions[:, 0], motions[:, 1]) >= LEAST_MOTION_PX
    return np.asarray(corners, np.float64).reshape(-1, 2)[sound], motions[sound]


def _common_origin(places: _Points, motions: _Points, start: _Points) -> _Points | None:
    """The point that most motions point away from, by least squares with weights for outliers."""
    along = motions / np.hypot(motions[:, 0], motions[:, 1])[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    focus = start
    for _ in range(_STEPS):
        off_angles, distances_px = _off_angles(places - focus, along, across)
        weights = (1 + (off_angles / OFF_ANGLE) ** 2) ** -2 / distances_px**2
        normal = (across * weights[:, None]).T @ across
        if not np.linalg.cond(normal) < _LARGEST_CONDITION:
            return None
        focus = np.linalg.solve(normal, across.T @ (weights * (across * places).sum(axis=1)))
    agree = _off_angles(places - focus, along, across)[0] <= MOST_OFF_ANGLE
    return focus if agree.mean() >= LEAST_AGREEING else None


def _off_angles(from_focus: _Points, along: _Points, across: _Points) -> tuple[_Points, _Points]:
    """Sines of the angles between lines from the focus and motions, infinite towards the focus.

    With the distances from the focus.
    """
    distances_px = np.maximum(np.hypot(from_focus[:, 0], from_focus[:, 1]), _NEAR_PX)
    sines = np.abs((across * from_focus).sum(axis=1)) / distances_px
    return np.where((along * from_focus).sum(axis=1) > 0, sines, np.inf), distances_px
