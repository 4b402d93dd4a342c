"""Where the rig's ends of one car's wires are, and where the car listens."""

from ipaddress import IPv4Address
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from onboard.settings import Settings

Port = Annotated[int, Field(ge=1, le=65535)]
LOOPBACK = IPv4Address("127.0.0.1")


class BusWire(Settings):
    """CAN bus on which the rig's ECU answers."""

    interface: Literal["socketcand", "socketcan", "slcan"] = "socketcand"
    """`socketcand`: the rig serves the bus over TCP. `socketcan`: an interface of the rig's kernel
    that exists and is up (can0, vcan0). `slcan`: a serial line to the box, which runs slcand."""
    channel: str = Field("can0", max_length=32, pattern=r"^[\w.:-]+$")
    """Name of the bus or interface."""
    host: IPv4Address = LOOPBACK
    """Address at which the rig serves the bus."""
    port: Port = 29536
    """TCP port at which the rig serves the bus."""
    serial: Path | None = None
    """Serial line or pty of `slcan`, set to its speed already."""

    @model_validator(mode="after")
    def _has_a_line_for_slcan(self) -> Self:
        if (self.interface == "slcan") != (self.serial is not None):
            raise ValueError("serial is required with slcan, and with nothing else")
        return self


class CameraWire(Settings):
    """Camera images as MJPEG: the rig serves them at `http://HOST:PORT/CAR`."""

    host: IPv4Address = LOOPBACK
    """Address at which the rig serves them."""
    port: Port
    """TCP port of the server."""


class RadioWire(Settings):
    """Radio unit. It sends each WSM to the car as a datagram."""

    endpoint: Literal["iwcu", "rsu41"] = "iwcu"
    """What it receives: a WSM, as of ITRI's IWCU (LCCA, section 4), or an Immediate Forward message
    of the USDOT RSU Specification 4.1."""
    host: IPv4Address = LOOPBACK
    """Address of the rig's unit."""
    port: Port
    """UDP port of the rig's unit."""
    box_host: IPv4Address = LOOPBACK
    """Where the car receives."""
    box_port: Port
    """UDP port on which the car receives."""


class DetectorWire(Settings):
    """Vehicle detections, as JSON by UDP."""

    host: IPv4Address = LOOPBACK
    """Where the car receives them."""
    port: Port
    """UDP port on which the car receives them."""


class SatelliteWire(Settings):
    """NMEA sentences of the GNSS receiver, by UDP to a gpsd (`udp://`) or to a serial line."""

    host: IPv4Address = LOOPBACK
    """Where gpsd receives them."""
    port: Port | None = None
    """UDP port on which gpsd receives them."""
    serial: Path | None = None
    """Serial line or pty, set to its speed already, instead of `host` and `port`."""

    @model_validator(mode="after")
    def _is_one_wire(self) -> Self:
        if (self.port is None) == (self.serial is None):
            raise ValueError("exactly one of port and serial")
        return self


class ControllerWire(Settings):
    """Requests to brake: the rig's controller receives them by UDP."""

    host: IPv4Address = LOOPBACK
    """Address of the rig's controller."""
    port: Port
    """UDP port of the rig's controller."""


class WireSettings(Settings):
    """All wires of one car."""

    bus: BusWire
    camera: CameraWire
    radio: RadioWire
    satellites: SatelliteWire | None = None
    """Required in a scenario with `gnss`."""
    detector: DetectorWire | None = None
    """Required in a scenario with `detector`."""
    controller: ControllerWire | None = None
    """Required for a car with `obeys_request`."""
