"""Settings of the connection to a detector of the user's."""

from pydantic import Field

from onboard.settings import Settings


class DetectorSettings(Settings):
    """A program that detects vehicles by camera, radar or lidar, and sends them by UDP."""

    host: str = Field("127.0.0.1", min_length=1)
    """Address to listen at; another one only if the detector runs on another computer."""
    port: int = Field(5300, ge=1, le=65535)
