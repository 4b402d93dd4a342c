"""How fast the camera turns to a side, by how far the picture shifts between two frames.

While the vehicle turns, all that is far away shifts alike, and what is nearer beside the road to
both sides, as the vehicle drives ahead. The shift is that of the strip at the horizon, by phase
correlation (Kuglin and Hines 1975, "The phase correlation image alignment method").
"""

import math

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.frame_admission import AdmittedFrame

STRIP_PX = 320
"""Width of the strip that is compared, or about that."""
ABOVE, BELOW = 0.3, 0.1
"""Height of the strip over and under the horizon, as shares of the picture's: below, it is road."""
LONGEST_S = 0.3
"""Time between two frames from which they are not compared: half of the strip is new at 1.7 rad/s
and 60 degrees. A rate that was not measured for so long is not used any more either."""
LEAST_RESPONSE = 0.3
"""Share of the strip's power at the peak from which the shift counts. It is 0.26 and more in 99 of
100 frames of each of the six labelled clips, and in most above 0.6."""
FASTEST_RAD_S = 1.3
"""Turn rate above which a picture is torn: a car turns so fast at 6.5 m/s in a radius of 5 m."""
SMOOTHED_S = 0.1
"""Time constant of the reported rate."""
_DARKEST = 8.0

_Strip = npt.NDArray[np.float32]


class CameraTurn:
    """Follows the turn rate of one camera."""

    def __init__(self) -> None:
        """Start with a camera that does not turn."""
        self.reset()

    def reset(self) -> None:
        """Start anew: the next frame is of another drive."""
        self._before: _Strip | None = None
        self._before_at = self._measured_at = -math.inf
        self.rate_rad_s = 0.0
        """Turn rate to the right."""

    def receive_frame(self, frame: AdmittedFrame) -> None:
        """Compare a frame with the one before."""
        step_px = max(1, round(frame.image.shape[1] / STRIP_PX))
        strip, before = _strip(frame, step_px), self._before
        took_s = frame.stamp_s - self._before_at
        self._before, self._before_at = strip, frame.stamp_s
        is_next = took_s <= LONGEST_S and not frame.is_cut
        if strip is None or before is None or before.shape != strip.shape or not is_next:
            self.rate_rad_s = 0.0
            return
        window = cv2.createHanningWindow(strip.shape[::-1], cv2.CV_32F)
        (shift_px, _), response = cv2.phaseCorrelate(before, strip, window)
        focal_px = frame.camera.perspective.width_px(1.0, 1.0) / step_px
        turn_rad_s = -math.atan(shift_px / focal_px) / took_s
        if response < LEAST_RESPONSE or abs(turn_rad_s) > FASTEST_RAD_S:
            if frame.stamp_s - self._measured_at > LONGEST_S:
                self.rate_rad_s = 0.0
            return
        self._measured_at = frame.stamp_s
        self.rate_rad_s += (1.0 - math.exp(-took_s / SMOOTHED_S)) * (turn_rad_s - self.rate_rad_s)


def _strip(frame: AdmittedFrame, step_px: int) -> _Strip | None:
    """The strip at the horizon, of which the brightest lamps count little more than the rest.

    Each row has a mean of 0: what is the same all along it shifts to nowhere. It is `None` where
    the picture does not show the horizon.
    """
    height_px = len(frame.image)
    _, horizon_px = frame.camera.perspective.straight_ahead_px
    top, bottom = (
        round(min(max(horizon_px + share * height_px, 0.0), height_px)) for share in (-ABOVE, BELOW)
    )
    rows, columns = (bottom - top) // step_px, frame.image.shape[1] // step_px
    if rows < 2 or columns < 2:
        return None
    # By a whole number, areas take a third of the time.
    whole = frame.image[top : top + rows * step_px, : columns * step_px]
    small = cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA)
    grey = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), np.float32)
    levels = np.log(cv2.GaussianBlur(grey, (0, 0), 1.0) + _DARKEST)
    return np.asarray(levels - levels.mean(axis=1, keepdims=True), np.float32)
