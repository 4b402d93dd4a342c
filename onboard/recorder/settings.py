"""Settings of the black box: content, size and retention of recordings."""

from pathlib import Path
from typing import Literal

from pydantic import Field

from onboard.settings import Settings


class RecorderSettings(Settings):
    """The black box. By default it records no plate in clear and no image."""

    folder: Path
    """Folder of the segments; created if missing, readable by its owner only."""
    plates: Literal["digests", "clear"] = "digests"
    """`digests`: an alias in place of each plate, constant within a drive and different in each.
    Recordings of both kinds can be replayed."""
    positions: bool = True
    """Whether positions, crossings and messages that may have a position are recorded;
    `replay --expect` needs them."""
    pictures_hz: float = Field(0.0, ge=0.0, le=30.0)
    """Rate of recorded camera images in Hz; they show plates and people."""
    picture_quality: int = Field(60, ge=1, le=100)
    """JPEG quality of the images."""
    segment_s: float = Field(60.0, ge=1.0, le=3600.0)
    """Duration of one segment in s. Segments are kept or deleted as a whole."""
    ring_s: float = Field(86_400.0, ge=60.0, le=3.2e7)
    """Age in s at which a segment without an event is deleted: a day."""
    ring_mib: float = Field(4096.0, ge=1.0)
    """Total size of all segments in MiB; the oldest are deleted first, those near an event last."""
    kept_ring_s: float = Field(2_592_000.0, ge=60.0, le=3.2e8)
    """Age in s at which a segment near an event is deleted: a month."""
    keep_s: float = Field(120.0, ge=0.0, le=3600.0)
    """Time before and after an event in s whose segments are kept longer. Events are warnings, hard
    braking and the brake button."""
