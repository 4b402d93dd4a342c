"""Settings of the live interface."""

from typing import Literal

from pydantic import Field

from onboard.settings import Settings

Accepted = Literal["brake_button", "object_list"]


class InterfaceSettings(Settings):
    """A TCP port of 127.0.0.1, which nobody outside of this computer reaches."""

    port: int = Field(8470, ge=1, le=65535)
    accepts: tuple[Accepted, ...] = ()
    """What programs may send: the test of the LCCA paper's brake button, which warns followers, and
    the lists of a detector, which needs the section `detector`."""
