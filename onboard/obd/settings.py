"""Settings of the vehicle's bus, and of requests and signals on it."""

from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from onboard.observations import Side
from onboard.settings import Settings

DEFAULT_CHANNEL = "can0"


class CanSettings(Settings):
    """The wire: a kernel interface, a socketcand server, or a recording played at its own pace."""

    interface: Literal["socketcan", "socketcand", "log"] = "socketcand"
    """`socketcan` is an interface of the kernel (can0, vcan0); `socketcand` is a server over
    TCP."""
    channel: str | None = Field(None, max_length=32, pattern=r"^[\w.:-]+$")
    """The bus: of the kernel or of the server (default can0), or of the recording (default all)."""
    host: str = Field("127.0.0.1", min_length=1)
    """Host of the socketcand server."""
    port: int = Field(29536, ge=1, le=65535)
    """Port of the socketcand server."""
    file: Path | None = None
    """The recording, in any format that python-can reads; only with `interface: log`."""
    repeat: bool = False
    """Whether the recording begins anew at its end; only with `interface: log`."""

    @model_validator(mode="after")
    def _file_belongs_to_log(self) -> Self:
        if (self.interface == "log") != (self.file is not None):
            raise ValueError("`file` is required with `interface: log`, and only there")
        if self.repeat and self.interface != "log":
            raise ValueError("`repeat` is allowed with `interface: log` only")
        return self


class BroadcastSettings(Settings):
    """Broadcast signals of the vehicle, named as `Message.Signal` of a DBC file."""

    dbc: Path
    """The vehicle's DBC file."""
    speed: tuple[str, ...] = ()
    """Vehicle or wheel speed; of several signals (all in one message), the median is used."""
    speed_unit: Literal["km/h", "m/s", "mph"] | None = None
    """Unit of the speed, if the DBC file has none or an unknown one."""
    brake_pedal: str | None = None
    """Signal of the brake pedal; pressed as `abs` is on."""
    turn_signal_left: str | None = None
    """Signal of the left turn signal: its lever or its lamp; on as `abs` is."""
    turn_signal_right: str | None = None
    """The same of the right one."""
    yaw_rate: str | None = None
    """Signal of the yaw rate."""
    yaw_rate_positive: Side = "left"
    """Side to which the vehicle turns while it is positive (ISO 8855: left)."""
    steering_angle: str | None = None
    """Signal of the angle of the steering wheel."""
    steering_angle_positive: Side = "left"
    """Side to which the wheel is turned while it is positive."""
    steering_m: float = Field(40.0, gt=1.0, le=200.0)
    """Steering ratio times wheelbase: the radius of the path while the wheel is turned by 1 rad."""
    angle_unit: Literal["deg", "rad"] | None = None
    """Unit of angle and yaw rate (a second), if the DBC file has none or an unknown one."""
    abs: str | None = None
    """Signal of active ABS. Of this, the next three and the turn signals, a signal of two bits is
    on with 1 only (SAE J1939-71: 2 is an error, 3 not available), any other one with all values but
    0."""
    stability_control: str | None = None
    """Signal of active stability control."""
    airbag: str | None = None
    """Signal of a deployed airbag."""
    hazard_lights: str | None = None
    """Signal of the hazard lights."""
    brake_pressure: str | None = None
    """Signal of the pressure in the brake's master cylinder."""
    brake_pressure_unit: Literal["bar", "kPa", "MPa"] | None = None
    """Unit of the pressure, if the DBC file has none or an unknown one."""
    brake_pressure_threshold_bar: float | None = Field(None, ge=5.0, le=250.0)
    """Pressure from which the vehicle brakes hard; required with `brake_pressure`."""

    @model_validator(mode="after")
    def _pressure_has_threshold(self) -> Self:
        if (self.brake_pressure is None) != (self.brake_pressure_threshold_bar is None):
            raise ValueError(
                "`brake_pressure_threshold_bar` is required with `brake_pressure`, and only there"
            )
        return self


class ObdSettings(Settings):
    """Requests to the vehicle's ECUs, and the threshold of hard braking."""

    addressing: Literal["auto", "11-bit", "29-bit"] = "auto"
    """Identifiers of ISO 15765-4; `auto` tries both."""
    polling_hz: float | None = Field(20.0, ge=1.0, le=20.0)
    """Requests of the speed a second; `None` sends none."""
    broadcast: BroadcastSettings | None = None
    """Broadcast signals; they are used instead of polled speed while they are recent."""
    hard_brake_threshold_g: float = Field(0.4, ge=0.1, le=1.0)
    """Deceleration of hard braking, in units of standard gravity."""
