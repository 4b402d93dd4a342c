"""Which bus the car has, and what is asked and read on it."""

from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from onboard.settings import Settings


class CanSettings(Settings):
    """The wire: a kernel interface, a socketcand server, or a recording played at its own pace."""

    interface: Literal["socketcan", "socketcand", "log"] = "socketcand"
    """`socketcan` is the kernel's (can0, vcan0); `socketcand` reaches a bus over TCP."""
    channel: str | None = Field(None, max_length=32, pattern=r"^[\w.:-]+$")
    """The bus: of the kernel or of the server (can0 if not set), or of the recording (all)."""
    host: str = Field("127.0.0.1", min_length=1)
    """Of the socketcand server."""
    port: int = Field(29536, ge=1, le=65535)
    """Of the socketcand server; 29536 is its own default."""
    file: Path | None = None
    """The recording, in any format that python-can reads; only with `interface: log`."""

    @model_validator(mode="after")
    def _file_belongs_to_log(self) -> Self:
        if (self.interface == "log") != (self.file is not None):
            raise ValueError("`file` is required with `interface: log`, and only there")
        return self


class BroadcastSettings(Settings):
    """Signals that the car sends by itself, named as `Message.Signal` of a DBC file."""

    dbc: Path
    """The car's DBC file."""
    speed: tuple[str, ...] = ()
    """Vehicle or wheel speed; of several (all in one message) the mean is taken."""
    speed_unit: Literal["km/h", "m/s", "mph"] | None = None
    """Where the DBC file names none, or one that is not known."""
    brake_pedal: str | None = None
    """Anything but 0 is a pressed pedal."""


class ObdSettings(Settings):
    """What is asked from the car's ECUs, and what braking is hard."""

    addressing: Literal["auto", "11-bit", "29-bit"] = "auto"
    """ISO 15765-4 identifiers; `auto` tries both."""
    polling_hz: float | None = Field(20.0, ge=1.0, le=20.0)
    """How often the speed is asked for; `None` only listens."""
    broadcast: BroadcastSettings | None = None
    """Preferred over polled speed while it is fresh, since it is finer and faster."""
    hard_brake_threshold_g: float = Field(0.4, ge=0.1, le=1.0)
    """Deceleration, in units of standard gravity, from which braking is hard."""
