"""What the air between the cars is like."""

from collections.abc import Mapping
from typing import Self

from pydantic import Field, model_validator

from onboard.settings import Settings
from sim_rig.names import CarName


class AirSettings(Settings):
    """Who hears whom, when, and how often not."""

    reach_m: float | None = Field(default=None, gt=0.0, le=10_000.0)
    """Up to this distance between two cars they hear each other."""
    neighbours: Mapping[CarName, tuple[CarName, ...]] | None = None
    """In the place of `reach_m`: who is heard by whom, both ways, wherever they are."""
    delay_s: float = Field(default=0.001, ge=0.0, le=10.0)
    """From unit to unit."""
    jitter_s: float = Field(default=0.0, ge=0.0, le=10.0)
    """Added to the delay, uniform from 0 up to this."""
    loss: float = Field(default=0.0, ge=0.0, le=1.0)
    """Part of the copies that do not arrive, each receiver for itself."""
    duplication: float = Field(default=0.0, ge=0.0, le=1.0)
    """Part of the copies that arrive twice."""
    reordering: float = Field(default=0.0, ge=0.0, le=1.0)
    """Part of the copies that are held back, so that later ones overtake them."""
    hold_back_s: float = Field(default=0.05, ge=0.0, le=10.0)
    """For how long."""

    @model_validator(mode="after")
    def _knows_who_hears_whom(self) -> Self:
        if (self.reach_m is None) == (self.neighbours is None):
            raise ValueError("exactly one of reach_m and neighbours")
        return self
