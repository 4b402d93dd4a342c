"""Which radio the car has, told apart by `endpoint`."""

from ipaddress import IPv4Address
from typing import Annotated, Literal

from pydantic import Field

from onboard.settings import Settings

Port = Annotated[int, Field(ge=1, le=65535)]


class _UnitOnIp(Settings):
    """A radio unit that is reached by UDP."""

    unit_host: IPv4Address = IPv4Address("127.0.0.1")
    """Where the unit is."""
    listen_host: IPv4Address = IPv4Address("127.0.0.1")
    """Own address that the unit sends to; 0.0.0.0 is all of them."""
    listen_port: Port
    """Own port that the unit sends to."""


class IwcuSettings(_UnitOnIp):
    """ITRI's WAVE Communication Unit and its like: a datagram is a WSM, nothing else."""

    endpoint: Literal["iwcu"]
    unit_port: Port
    """Where the unit takes WSMs to send."""


class Rsu41Settings(_UnitOnIp):
    """A radio that speaks the USDOT RSU Specification 4.1, as most on the market do."""

    endpoint: Literal["rsu41"]
    unit_port: Port = 1516
    """Where the unit takes Immediate Forward messages; 1516 is the specification's."""
    channel: int = Field(172, ge=0, le=255)
    """`TxChannel` of WSMs that name none."""
    forwarded_psid: int | None = Field(None, ge=0, le=0x1020407F)
    """PSID of 1609.2 data that the unit forwards without WSMP header; `None` discards it."""


class RawSettings(Settings):
    """The link layer itself: OCB-mode Wi-Fi, or veth. Needs CAP_NET_RAW and CAP_NET_ADMIN."""

    endpoint: Literal["raw"]
    interface: str = Field(min_length=1, max_length=15)
    """Such as wlan0."""


RadioSettings = Annotated[
    IwcuSettings | Rsu41Settings | RawSettings, Field(discriminator="endpoint")
]
"""One of the three."""
