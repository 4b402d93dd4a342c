"""Settings of the traffic around a scenario's cars."""

from pydantic import Field

from onboard.settings import Settings


class BackgroundSettings(Settings):
    """Source of the motion of the background traffic, on the plane of the scenario's roads."""

    source: str
    """`sumo-dense-highway` or another source by name, a `.sumocfg`, or a trace file. Drivers of
    SUMO react to the scenario's cars."""
    from_s: float = Field(default=0.0, ge=0.0)
    """Time of the source at the start of the scenario."""
