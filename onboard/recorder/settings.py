"""What is recorded, how much of it is kept, and for how long."""

from pathlib import Path
from typing import Literal

from pydantic import Field

from onboard.settings import Settings


class RecorderSettings(Settings):
    """The black box. Its defaults record no plate in clear and no picture."""

    folder: Path
    """Where the segments go; made if it is not there, readable by its owner only."""
    plates: Literal["digests", "clear"] = "digests"
    """`digests` stands for a plate by a word that is the same within one drive, and means nothing
    outside of it. Both replay."""
    positions: bool = True
    """Own fixes and everybody's BSMs. Without them a recording is no proof: it cannot be replayed
    with `--expect`."""
    pictures_hz: float = Field(0.0, ge=0.0, le=30.0)
    """How many of the camera's pictures a second, as JPEG; they show plates and people."""
    picture_quality: int = Field(60, ge=1, le=100)
    """Of the JPEG."""
    segment_s: float = Field(60.0, ge=1.0, le=3600.0)
    """How much one file holds. Whole files are kept or given up."""
    ring_s: float = Field(86_400.0, ge=60.0, le=3.2e7)
    """How old a segment becomes that nothing happened in: a day."""
    ring_mib: float = Field(4096.0, ge=1.0)
    """How much disk all segments take; beyond it the oldest go, those around an event last."""
    kept_ring_s: float = Field(2_592_000.0, ge=60.0, le=3.2e8)
    """The same for those around an event: a month."""
    keep_s: float = Field(120.0, ge=0.0, le=3600.0)
    """How much before and after a warning, a hard brake or the button is kept when its time is
    over."""
