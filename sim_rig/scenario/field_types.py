"""The few types that every part of a scenario is written in."""

from typing import Annotated

from pydantic import Field, StringConstraints

CarName = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*$", max_length=20)]
RoadName = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*$", max_length=20)]
PlateText = Annotated[str, StringConstraints(pattern=r"^[A-Z0-9]{1,10}$")]
"""As the camera of the car behind reads it: upper case, no separators."""
Seconds = Annotated[float, Field(ge=0.0, le=3600.0)]
"""Since the scenario began."""
