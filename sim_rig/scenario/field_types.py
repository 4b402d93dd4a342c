"""Field types that all parts of a scenario share."""

from typing import Annotated

from pydantic import Field, StringConstraints

CarName = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*$", max_length=20)]
RoadName = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*$", max_length=20)]
PlateText = Annotated[str, StringConstraints(pattern=r"^[A-Z0-9]{1,10}$")]
"""Text of a number plate: upper case, without separators."""
Seconds = Annotated[float, Field(ge=0.0, le=3600.0)]
"""Time since the start of the scenario."""
