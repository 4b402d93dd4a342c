"""What impairs the picture, as the driver is to know: a turned, dirty, blurred or dazzled camera.

One picture a second is examined, and the next one beside it shows where the vehicle heads. What is
reported has been there for some seconds; a blurred or dazzled picture makes ranges less certain at
once. Whether the camera is turned or dirty is judged only while the vehicle drives ahead. A camera
of unknown mounting is not turned or dirty: it is taken to look to where the vehicle heads.
"""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox, Impairment, Sensor, SensorImpaired
from onboard.vision.blur import BLURRED, blur_of, detail
from onboard.vision.focus_of_expansion import focus_of_expansion
from onboard.vision.frame_admission import AdmittedFrame
from onboard.vision.free_lane import LEAST_LEVEL
from onboard.vision.horizon import COLUMNS
from onboard.vision.lane import LaneShape

PERIOD_S, PAIR_S = 1.0, 0.2
"""Time between two examined pictures, and the longest between the two of a pair."""
LEGIBLE, LEGIBLE_S = 0.9, 2.5
"""Probability of a plate's text from which its picture is not blurred, and for how long a reading
says so: the plate of an identified lead is read once a second."""
RANGE_SIGMA = {
    Impairment.TURNED: 0.3,
    Impairment.DIRTY: 0.25,
    Impairment.BLURRED: 0.25,
    Impairment.OVER_EXPOSED: 0.15,
}
"""Relative sigma of ranges that each adds, from the labelled photographs disturbed by known amounts
(`python -m bench.impaired_pictures`); dirt is taken for blur."""
DARK_LEVEL, DARK_SIGMA = 30.0, 0.16
"""Median grey level of the road below which the picture is dark, and what that adds, as above. Of
the photographs all have more, and nine in ten less once they are darkened by a gamma of 2.5; of the
clips, those by night included, all that show a road have 43 and more."""
GAIN, PRESENT, GONE = 0.3, 0.8, 0.5
"""Weight of each picture in the share of impaired ones, and the shares from which an impairment is
present, after five of them, and below which it is gone, after two without."""
TURNED_RAD = 0.035
"""Angle between where the camera should look and where it does, from which it is turned (2
degrees): of the clips, half of the pictures differ by up to that from their median, in bends."""
FOCUSES, LEAST_FOCUSES = 20, 8
"""Pictures by which it is judged, at most and at least."""
LEAST_HEADINGS = 5
"""The same by which a camera of unknown mounting is turned: it only was assumed to look ahead."""


class PictureWatch:
    """Watches the pictures of one camera."""

    def __init__(self, lane_width_m: float, *, has_mounting: bool = True) -> None:
        """Start with a clear picture.

        Args:
            lane_width_m: of a common lane.
            has_mounting: whether it is known where the camera looks.
        """
        self._lane = LaneShape(lane_width_m)
        self._has_mounting = has_mounting
        self.reset()

    def reset(self) -> None:
        """Start anew: the next frame is of another drive."""
        self._examined_at = self._legible_at = -math.inf
        self._first: npt.NDArray[np.uint8] | None = None
        """The first picture of a pair."""
        self._shares = dict.fromkeys((Impairment.BLURRED, Impairment.OVER_EXPOSED), 0.0)
        """Shares of pictures with it."""
        self._unsharp = np.zeros(COLUMNS)
        """Shares of pictures without edges, of each part of the horizon."""
        self._turns: deque[npt.NDArray[np.float64]] = deque(maxlen=FOCUSES)
        """Angles to the right and down from where the camera should look."""
        self._momentary: frozenset[Impairment] = frozenset()
        self._is_dark = False
        self._present: frozenset[Impairment] = frozenset()

    @property
    def is_clear(self) -> bool:
        """Whether nothing impairs the picture for longer than a moment."""
        return not self._present

    @property
    def range_sigma(self) -> float:
        """Relative sigma of ranges by what impairs the picture, now or for longer."""
        sigmas = [RANGE_SIGMA[each] for each in self._present | self._momentary]
        return max([*sigmas, DARK_SIGMA if self._is_dark else 0.0])

    @property
    def bearing_sigma_rad(self) -> float:
        """Sigma of all bearings: the angle by which the camera is turned to a side."""
        if Impairment.TURNED not in self._present:
            return 0.0
        return abs(float(np.median(self._turns, axis=0)[0]))

    def take_turn_rad(self) -> float:
        """Angle by which a camera of unknown mounting is to be turned to the left, 0 for none.

        The next frames are by the turned camera. Three quarters of the pictures agree on the side.
        """
        if self._has_mounting or len(self._turns) < LEAST_HEADINGS:
            return 0.0
        lower, turn_rad, upper = np.quantile(np.array(self._turns)[:, 0], (0.25, 0.5, 0.75))
        if max(lower, -upper) < TURNED_RAD:
            return 0.0
        self._turns = deque((each - (turn_rad, 0.0) for each in self._turns), maxlen=FOCUSES)
        return float(turn_rad)

    def receive_frame(
        self, frame: AdmittedFrame, vehicles: Sequence[ImageBox], legibility: float
    ) -> list[SensorImpaired]:
        """Examine a frame if it is due, and report what impairs the camera if that has changed.

        Args:
            frame: of the camera.
            vehicles: where vehicles are seen: these hide the horizon.
            legibility: largest probability of a plate's text that was read in the frame, 0 without.
        """
        if legibility >= LEGIBLE:
            self._legible_at = frame.stamp_s
        first, self._first = self._first, None
        if first is not None and frame.stamp_s - self._examined_at <= PAIR_S:
            self._examine_motion(frame, first, vehicles)
        elif frame.stamp_s - self._examined_at >= PERIOD_S:
            self._examined_at = frame.stamp_s
            self._first = detail(frame.image)
            self._examine_light(frame, self._first)
        else:
            return []
        return self._changed(frame.stamp_s)

    def _examine_light(self, frame: AdmittedFrame, grey: npt.NDArray[np.uint8]) -> None:
        """Whether it is blurred, over-exposed or dark."""
        rows = len(grey)
        self._is_dark = float(np.median(grey[rows // 2 : rows - rows // 8])) < DARK_LEVEL
        is_legible = frame.stamp_s - self._legible_at <= LEGIBLE_S
        is_so = {
            Impairment.BLURRED: not is_legible and blur_of(grey) >= BLURRED,
            Impairment.OVER_EXPOSED: frame.is_over_exposed,
        }
        self._momentary = frozenset(each for each in is_so if is_so[each])
        for each, share in self._shares.items():
            self._shares[each] = share + GAIN * (is_so[each] - share)

    def _examine_motion(
        self,
        frame: AdmittedFrame,
        first: npt.NDArray[np.uint8],
        vehicles: Sequence[ImageBox],
    ) -> None:
        """Whether the camera is turned, or dirty: what it sees moves, but dirt does not."""
        camera = frame.camera
        second = detail(frame.image)
        if first.shape != second.shape:
            return
        focus = focus_of_expansion(first, second)
        if focus is None or not 0.0 <= focus[0] <= first.shape[1]:
            return  # while the vehicle turns, the focus is beside the picture
        scale = frame.image.shape[1] / first.shape[1]
        ahead_px = camera.perspective.straight_ahead_px
        off_px = np.multiply(focus, scale) - ahead_px
        self._turns.append(np.arctan(off_px / camera.perspective.width_px(1.0, 1.0)))
        if camera.horizon is None or self._momentary:
            return  # nothing is known of the horizon, or nothing is sharp
        if np.abs(np.median(self._turns, axis=0)).max() >= TURNED_RAD:
            if self._is_turned():
                self._unsharp[:] = 0.0  # what was seen there before says nothing of now
            return  # it is elsewhere
        parts = camera.horizon.parts(frame.image, self._lane)
        for index, part in enumerate(parts):
            is_seen = part.is_sharp or part.level < LEAST_LEVEL
            is_hidden = any(0 <= part.x_px - each.x_px <= each.w_px for each in vehicles)
            self._unsharp[index] += GAIN * ((not is_seen and not is_hidden) - self._unsharp[index])

    def _is_turned(self) -> bool:
        """Whether three quarters of the pictures are turned to the same side."""
        if not self._has_mounting or len(self._turns) < LEAST_FOCUSES:
            return False
        lower, upper = np.quantile(np.array(self._turns), (0.25, 0.75), axis=0)
        return bool(np.maximum(lower, -upper).max() >= TURNED_RAD)

    def _changed(self, stamp_s: float) -> list[SensorImpaired]:
        """Report what impairs the camera, if it is not the same as before."""
        shares = self._shares | {Impairment.DIRTY: float(self._unsharp.max())}
        present = {
            each
            for each, share in shares.items()
            if share >= (GONE if each in self._present else PRESENT)
        }
        if self._is_turned():
            present.add(Impairment.TURNED)
        if present == self._present:
            return []
        self._present = frozenset(present)
        return [SensorImpaired(stamp_s, Sensor.CAMERA, tuple(sorted(present)))]
