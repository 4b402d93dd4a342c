"""What one look at one frame gives: plates, tags and vehicles, each put into metres."""

from dataclasses import dataclass
from enum import StrEnum

from onboard.observations import Box
from onboard.vision.perspective import Corners, Place


class Cue(StrEnum):
    """What gave a car away."""

    PLATE = "plate"
    TAG = "tag"
    VEHICLE = "vehicle"


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """One cue in one frame."""

    cue: Cue
    corners_px: Corners
    place: Place
    ahead_sigma_m: float
    right_sigma_m: float
    text: str | None = None
    confidence: float = 0.0
    """Of the text, 0 to 1."""
    character_confidences: tuple[float, ...] = ()

    @property
    def box(self) -> Box:
        """The upright rectangle around the corners."""
        left, top = (float(value) for value in self.corners_px.min(axis=0))
        right, bottom = (float(value) for value in self.corners_px.max(axis=0))
        return Box(left, top, right - left, bottom - top)
