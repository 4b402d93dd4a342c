"""Where a detector of the user's sends what it finds."""

from pydantic import Field

from onboard.settings import Settings


class DetectorSettings(Settings):
    """A program that finds cars, by camera, radar or lidar, and sends them by UDP."""

    host: str = Field("127.0.0.1", min_length=1)
    """To listen at; another one only where the detector runs on another machine."""
    port: int = Field(5300, ge=1, le=65535)
