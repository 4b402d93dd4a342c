"""Settings of the radio unit; `endpoint` selects its kind."""

from enum import StrEnum
from ipaddress import IPv4Address
from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from onboard.settings import Settings

Port = Annotated[int, Field(ge=1, le=65535)]


class RadioProfile(StrEnum):
    """Which messages and headers are sent and received."""

    WAVE = "wave"
    """SAE J2735 in WSMP."""
    ITS_G5 = "its-g5"
    """ETSI ITS in GeoNetworking."""


class CongestionControlApproach(StrEnum):
    """By which ITS-G5 sends less often on a busy channel (ETSI TS 102 687)."""

    REACTIVE = "reactive"
    """A table of states."""
    ADAPTIVE = "adaptive"
    """Vehicles share what the channel bears."""


class _Profiled(Settings):
    profile: RadioProfile = RadioProfile.WAVE
    """`its-g5` is Europe's."""
    congestion_control: CongestionControlApproach = CongestionControlApproach.ADAPTIVE
    """Of `its-g5`; BSMs follow SAE J2945/1."""

    @field_validator("congestion_control")
    @classmethod
    def _is_of_its_g5(
        cls, approach: CongestionControlApproach, info: ValidationInfo
    ) -> CongestionControlApproach:
        if info.data.get("profile") is RadioProfile.WAVE:
            raise ValueError(
                f"{approach} is of the profile its-g5; BSMs follow SAE J2945/1: leave it out"
            )
        return approach


class _UnitOnIp(_Profiled):
    """A radio unit that is reached by UDP."""

    unit_host: IPv4Address = IPv4Address("127.0.0.1")
    """Address of the unit."""
    listen_host: IPv4Address = IPv4Address("127.0.0.1")
    """Own address that the unit sends to; 0.0.0.0 stands for all."""
    listen_port: Port
    """Own port that the unit sends to."""


class IwcuSettings(_UnitOnIp):
    """ITRI's WAVE Communication Unit and compatible ones: each datagram is one frame."""

    endpoint: Literal["iwcu"]
    unit_port: Port
    """Port on which the unit accepts WSMs."""


class Rsu41Settings(_UnitOnIp):
    """A radio unit of the USDOT RSU Specification 4.1, as most on the market are."""

    endpoint: Literal["rsu41"]
    profile: Literal[RadioProfile.WAVE] = RadioProfile.WAVE
    """Its messages have a PSID, which no GeoNetworking packet has."""
    unit_port: Port = 1516
    """Port on which the unit accepts Immediate Forward messages; the specification has 1516."""
    channel: int = Field(172, ge=0, le=255)
    """`TxChannel` for WSMs that name none."""
    forwarded_psid: int | None = Field(None, ge=0, le=0x1020407F)
    """PSID for 1609.2 data that the unit forwards without WSMP header; `None` discards it."""


class RawSettings(_Profiled):
    """The link layer itself: OCB-mode Wi-Fi, or veth. Needs CAP_NET_RAW and CAP_NET_ADMIN."""

    endpoint: Literal["raw"]
    interface: str = Field(min_length=1, max_length=15)
    """Such as wlan0."""


RadioSettings = Annotated[
    IwcuSettings | Rsu41Settings | RawSettings, Field(discriminator="endpoint")
]
"""One of the three kinds."""
