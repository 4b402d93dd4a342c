"""Whether this car talks as often as its driver's danger demands."""

from pathlib import Path
from typing import Self

from pydantic import Field, model_validator

from onboard.bsm_transmission.schedule import MAXIMUM_INTERVAL_S, MINIMUM_INTERVAL_S
from onboard.settings import Settings


class AccessSettings(Settings):
    """Driver-based channel access."""

    enabled: bool = False
    """The one switch. Off, reactions are not watched and BSMs go out as SAE J2945/1 alone says."""
    driver_file: Path | None = None
    """What has been learned of the driver, from one drive to the next. It never leaves the box;
    deleting it erases what is known. `None` keeps nothing."""
    unsafe_above: float = Field(0.5, gt=0.0, lt=1.0)
    """Probability of running into the car ahead, should it brake, above which the car is unsafe."""
    safe_below: float = Field(0.4, gt=0.0, lt=1.0)
    """And below which it is safe again. The margin keeps a noisy gap from flapping."""
    unsafe_interval_s: float = Field(
        MINIMUM_INTERVAL_S, ge=MINIMUM_INTERVAL_S, le=MAXIMUM_INTERVAL_S
    )
    """An unsafe car's BSMs are at most so far apart, however many cars are near."""
    hold_s: float = Field(1.0, gt=0.0, le=10.0)
    """How long a sight of the car ahead is good for; with none the car is safe."""
    deceleration_low_m_s2: float = Field(4.0, gt=0.0, le=12.0)
    deceleration_high_m_s2: float = Field(8.0, gt=0.0, le=12.0)
    """How hard cars brake, nobody knowing which: evenly from low to high (Table III)."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.safe_below > self.unsafe_above:
            raise ValueError("safe_below must not exceed unsafe_above")
        if self.deceleration_low_m_s2 > self.deceleration_high_m_s2:
            raise ValueError("deceleration_low_m_s2 must not exceed deceleration_high_m_s2")
        return self
