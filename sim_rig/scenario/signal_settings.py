"""Settings of a signalised crossing with a road-side unit."""

from collections.abc import Mapping
from typing import Annotated, Self

from pydantic import Field, model_validator

from onboard.settings import Settings
from sim_rig.scenario.field_types import RoadName

_InCycle = Annotated[float, Field(ge=0.0, le=300.0)]
Metres = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]


class SignalApproach(Settings):
    """Lane 1 of a road, up to its stop line."""

    stop_line_m: Metres
    """Along the road."""
    green_s: tuple[_InCycle, _InCycle]
    """Beginning and end of green in the cycle; yellow follows, then red."""


class SignalSettings(Settings):
    """A fixed-time signal controller; the first cycle begins with the scenario."""

    place_m: tuple[Metres, Metres] = (0.0, 0.0)
    """Antenna of the road-side unit: east and north of the scenario's origin."""
    cycle_s: float = Field(default=60.0, ge=10.0, le=300.0)
    yellow_s: float = Field(default=3.0, ge=0.0, le=10.0)
    lane_length_m: float = Field(default=200.0, ge=10.0, le=300.0)
    """Of the lanes in the MAP message."""
    approaches: Mapping[RoadName, SignalApproach] = Field(min_length=1, max_length=250)

    @model_validator(mode="after")
    def _fits_the_cycle(self) -> Self:
        for road, approach in self.approaches.items():
            begins_s, ends_s = approach.green_s
            if not begins_s < ends_s <= self.cycle_s - self.yellow_s:
                raise ValueError(
                    f"green of {road} must begin before it ends, and leave {self.yellow_s:g} s of"
                    f" yellow in the cycle of {self.cycle_s:g} s"
                )
        return self
