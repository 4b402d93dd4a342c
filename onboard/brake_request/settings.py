"""Settings of the requests to brake, and of where they are sent."""

from pathlib import Path
from typing import Self

from pydantic import Field, model_validator

from onboard.obd.settings import CanSettings
from onboard.settings import Settings


class RequestDatagramSettings(Settings):
    """A controller that receives JSON by UDP."""

    host: str = Field("127.0.0.1", min_length=1)
    """Another computer's address only if the controller runs there."""
    port: int = Field(5310, ge=1, le=65535)
    """UDP port of the controller."""


class RequestFrameSettings(CanSettings):
    """A controller on a CAN bus other than that of the OBD port.

    Signals are named as `Message.Signal` of a DBC file, all in one message.
    """

    dbc: Path
    """The DBC file of the controller."""
    deceleration: str
    """Requested deceleration in m/s^2, positive or 0."""
    certainty: str | None = None
    """Certainty from 0 to 1, or from 0 to 100 with the unit `%`."""
    is_requested: str | None = None
    """1 while braking is requested, 0 in the last frame."""
    counter: str | None = None
    """Grows by 1 from frame to frame, and wraps."""
    checksum: str | None = None
    """One byte: CRC-8 of SAE J1850 over the frame with 0 in its place."""

    @model_validator(mode="after")
    def _is_a_bus_with_a_name(self) -> Self:
        if self.interface == "log":
            raise ValueError("a recording takes no frames: interface must be socketcan, socketcand")
        if self.channel is None:
            raise ValueError("`channel` is required here: it must not be that of the OBD port")
        return self


class BrakeRequestSettings(Settings):
    """When braking is requested, and where that is sent; without `udp` and `can`, only traced."""

    udp: RequestDatagramSettings | None = None
    """A controller that receives JSON by UDP; null for none."""
    can: RequestFrameSettings | None = None
    """A controller on a CAN bus; null for none."""
    most_m_s2: float = Field(6.0, ge=1.0, le=10.0)
    """Hardest braking that is requested."""
    crossing_m_s2: float = Field(5.0, ge=1.0, le=10.0)
    """Braking requested by IMA and LTA, at most `most_m_s2`; UN R152 asks for 5 m/s^2."""
    least_certainty: float = Field(0.85, gt=0.0, le=1.0)
    """Certainty from which braking is requested. By default, radio alone does not suffice."""
    own_sensors_certainty: float = Field(0.9, ge=0.0, le=1.0)
    """That a vehicle seen by the camera or the detector is there: an assumption, not measured."""
    radio_certainty: float = Field(0.8, ge=0.0, le=1.0)
    """The same of what others send: an assumption too."""
