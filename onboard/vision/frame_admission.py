"""The first step of a frame: one that is late, faulty or of another shape goes no further."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from onboard.observations import Discarded
from onboard.vision.frame_check import FrameCheck
from onboard.vision.sized_camera import SizedCamera, SizedCameras

COMPONENT = "vision"


@dataclass(frozen=True, slots=True, eq=False)
class AdmittedFrame:
    """A frame that the later steps get."""

    image: npt.NDArray[np.uint8]
    """(h, w, 3), BGR."""
    stamp_s: float
    camera: SizedCamera
    """The camera with frames of this size."""
    is_repeat: bool
    """Whether it shows the same image as the frame before."""
    is_cut: bool
    """Whether the frame before showed another scene."""
    may_hide_vehicles: bool
    """Whether a lane without any is not known to be free."""
    is_over_exposed: bool
    """Whether much of the road is white."""


class FrameAdmission:
    """Admits frames in order of time."""

    def __init__(self, cameras: SizedCameras) -> None:
        """Take what knows the sizes that frames may have."""
        self._cameras = cameras
        self._check = FrameCheck()
        self._stamp_s = -math.inf

    def reset(self) -> None:
        """Forget all frames: the next one is of another drive."""
        self._check, self._stamp_s = FrameCheck(), -math.inf

    def admit(self, image: npt.NDArray[np.uint8], stamp_s: float) -> AdmittedFrame | Discarded:
        """Check one frame, (h, w, 3) uint8 BGR; an empty array is one that did not decode."""
        if stamp_s <= self._stamp_s:
            detail = f"not after {self._stamp_s:.3f} s"
            return Discarded(stamp_s, COMPONENT, "old_frame", detail)
        verdict = self._check.check(image)
        if verdict.fault is not None:
            return Discarded(stamp_s, COMPONENT, verdict.fault, verdict.detail)
        height_px, width_px = image.shape[:2]
        camera = self._cameras.for_size(width_px, height_px)
        if camera is None:
            detail = self._cameras.describe(width_px, height_px)
            return Discarded(stamp_s, COMPONENT, "frame_size", detail)
        self._stamp_s = stamp_s
        return AdmittedFrame(
            image,
            stamp_s,
            camera,
            is_repeat=verdict.is_repeat,
            is_cut=verdict.is_cut,
            may_hide_vehicles=verdict.may_hide_vehicles,
            is_over_exposed=verdict.is_over_exposed,
        )
