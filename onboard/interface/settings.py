"""Settings of the live interface."""

from typing import Literal

from pydantic import Field, field_validator

from onboard.settings import Settings
from onboard.wave_udp import psid
from onboard.wave_udp.settings import Port

Accepted = Literal["brake_button", "object_list"]


class SentService(Settings):
    """A service in which programs may have the vehicle send."""

    psid: int = Field(ge=0, le=psid.HIGHEST)
    """PSID or ITS-AID, which the vehicle's certificates must permit."""
    btp_port: Port | None = None
    """With the profile its-g5, to which port."""


class InterfaceSettings(Settings):
    """A TCP port of 127.0.0.1, which nobody outside of this computer reaches."""

    port: int = Field(8470, ge=1, le=65535)
    accepts: tuple[Accepted, ...] = ()
    """What programs may send: the test of the LCCA paper's brake button, which warns followers, and
    the lists of a detector, which needs the section `detector`."""
    sends: tuple[SentService, ...] = ()
    """Services in whose messages programs speak for the vehicle: it signs what they send."""

    @field_validator("sends")
    @classmethod
    def _are_of_nobody_here(cls, sends: tuple[SentService, ...]) -> tuple[SentService, ...]:
        psids, ports = [each.psid for each in sends], [each.btp_port for each in sends]
        for each in sends:
            if psids.count(each.psid) > 1:
                raise ValueError(f"psid 0x{each.psid:X} stands twice")
            if each.btp_port is not None and ports.count(each.btp_port) > 1:
                raise ValueError(f"btp_port {each.btp_port} stands twice")
            if each.psid in psid.OWN:
                raise ValueError(f"psid 0x{each.psid:X} is of the vehicle's own messages")
        return sends
