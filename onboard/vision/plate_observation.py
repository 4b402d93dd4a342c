"""Where to look in one frame, and what it gives: plates, tags and vehicles, put into metres."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from onboard.observations import ImageBox
from onboard.vision.perspective import Corners, RoadPosition, bounding_box


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
    place: RoadPosition
    ahead_sigma_m: float
    right_sigma_m: float
    text: str | None = None
    confidence: float = 0.0
    """Of the text, 0 to 1."""
    character_confidences: tuple[float, ...] = ()
    identity_confidence: float = 0.0
    """Of the text, but for characters that no identity tells apart."""
    was_read: bool = True
    """Whether it was tried what text it carries."""
    shape: float = 0.0
    """Of a plate: width by height."""
    has_band: bool = False
    """Whether a blue band was found at its left end."""
    width_m: float = 0.0
    """Of a plate: what `place` takes it to be."""
    places: Mapping[float, RoadPosition] = field(default_factory=dict)
    """Of a plate that is seen whole: where it is, for each width that it may have."""

    @property
    def box(self) -> ImageBox:
        """The upright rectangle around the corners."""
        return bounding_box(self.corners_px)

    def if_wide(self, width_m: float) -> "Sighting":
        """The same plate, taken to be of another width: as much farther away."""
        if not self.places:
            return self
        factor = width_m / self.width_m
        return replace(
            self,
            place=self.places[width_m],
            ahead_sigma_m=factor * self.ahead_sigma_m,
            right_sigma_m=factor * self.right_sigma_m,
            width_m=width_m,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """A car that is tracked, and where it is looked for."""

    cue: Cue
    """What it was last seen by."""
    corners_px: Corners
    """Where."""
    region: ImageBox
    """Where it may have moved to since."""
    was_seen: bool
    """In the last frame that it was looked for in."""
    read_again: bool
    """Whether its plate is to be read; a known one need not be in every frame."""


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """Where to look in one frame: everywhere, or where cars are that are tracked."""

    area: ImageBox | None = None
    """Of a search everywhere, the part of the picture that shows the road; `None` is all of it."""
    followed: tuple[Followed, ...] | None = None
    """`None` searches everywhere."""
    read_already: tuple[ImageBox, ...] = ()
    """Of a search everywhere: plates that were read not long ago."""
