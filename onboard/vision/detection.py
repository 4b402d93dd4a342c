"""Detections of plates, tags and vehicles in one frame, and the regions to search for them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from onboard.observations import ImageBox, PlateCandidate
from onboard.vision.perspective import Corners, RoadPosition, bounding_box
from onboard.vision.plate_views import PlateViews

LARGE_PX = 2_500_000
"""Pixels from which all of an image is searched at half its size, and what is found there at full
size: for tags, and for plates where vehicles are found as such, whose rears are searched, too."""


class DetectionKind(StrEnum):
    """Kinds of features by which a vehicle is detected."""

    PLATE = "plate"
    TAG = "tag"
    VEHICLE = "vehicle"


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """A plate, tag or vehicle in one frame, with its position in metres."""

    kind: DetectionKind
    corners_px: Corners
    position: RoadPosition
    ahead_sigma_m: float
    right_sigma_m: float
    text: str | None = None
    confidence: float = 0.0
    """Probability that the text is right, 0 to 1."""
    identity_confidence: float = 0.0
    """The same, with 0 and O, and 1 and I, counted as equal."""
    candidates: tuple[PlateCandidate, ...] = ()
    """Texts by this reading, the likeliest first."""
    seen: PlateViews | None = None
    """Views of earlier frames that the reading took part of."""
    views: PlateViews | None = None
    """The same with this frame's."""
    was_read: bool = True
    """Whether reading the text was tried."""
    shape: float = 0.0
    """Width divided by height, of a plate."""
    has_band: bool = False
    """Whether a blue band was found at its left end."""
    width_m: float = 0.0
    """Width that `position` assumes, of a plate."""
    ahead_by_size_m: float | None = None
    """Distance by the width of a vehicle's rear alone, if it is seen whole."""
    may_cross: bool = False
    """Whether it is a vehicle that shows its whole side: it may drive across."""
    positions: Mapping[float, RoadPosition] = field(default_factory=dict)
    """Position for each possible width in m; empty unless it is a plate that is seen whole."""

    @property
    def box(self) -> ImageBox:
        """The upright rectangle around the corners."""
        return bounding_box(self.corners_px)

    def unread(self) -> "Detection":
        """The same plate without its reading."""
        return replace(
            self,
            text=None,
            confidence=0.0,
            identity_confidence=0.0,
            candidates=(),
            seen=None,
            views=None,
            was_read=False,
        )

    def with_width(self, width_m: float) -> "Detection":
        """The same plate with another width, at a distance in proportion to it."""
        if not self.positions or width_m == self.width_m:
            return self
        factor = width_m / self.width_m
        return replace(
            self,
            position=self.positions[width_m],
            ahead_sigma_m=factor * self.ahead_sigma_m,
            right_sigma_m=factor * self.right_sigma_m,
            width_m=width_m,
        )


@dataclass(frozen=True, slots=True, eq=False)
class TrackRegion:
    """Region in which a track's detection is searched."""

    kind: DetectionKind
    """Kind of its last detection."""
    corners_px: Corners
    """Corners of its last detection, moved with the rear since."""
    region: ImageBox
    """Where it can be in this frame."""
    was_detected: bool
    """Whether the last search of it succeeded."""
    read_text: bool
    """Whether the plate is to be read in this frame."""
    views: PlateViews | None = None
    """Its views of earlier frames."""


@dataclass(frozen=True, slots=True, eq=False)
class SearchPlan:
    """What is searched in one frame: all of it, or the regions of some tracks."""

    area: ImageBox | None = None
    """Part of the image that a search of the whole frame covers; `None` is all of it."""
    tracked: tuple[TrackRegion, ...] | None = None
    """Regions to search; `None` searches the whole frame."""
    known: tuple[TrackRegion, ...] = ()
    """Tracks whose plates a search of the whole frame finds again."""
    vehicles: bool = False
    """Whether all of the frame is searched for vehicles."""
    rears: tuple[ImageBox, ...] = ()
    """Rears around which vehicles are searched, if not all of the frame is."""
    looks_ahead: bool = False
    """Whether all vehicles ahead are found or known: then the lane between them is examined."""
    finds_vehicles: bool = False
    """Whether vehicles are found as such, in this frame or another, and their rears searched."""
