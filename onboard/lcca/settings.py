"""What a user may set of the warning group: how close is too close, and the forwarding slot."""

from dataclasses import replace
from typing import Self

from pydantic import Field, model_validator

from onboard.lcca.parameters import DEFAULTS, GroupParameters
from onboard.settings import Settings


class LccaSettings(Settings):
    """The warning group."""

    join_headway_s: float = Field(DEFAULTS.join_headway_s, gt=0.0, le=10.0)
    """Below it the car joins its lead: 0.55 m for each km/h (LCCA, section 3)."""
    leave_headway_s: float = Field(DEFAULTS.leave_headway_s, gt=0.0, le=10.0)
    """From it on the car leaves; not less than `join_headway_s`."""
    slot_s: float = Field(DEFAULTS.slot_s, gt=0.0, le=0.5)
    """Forwarding slot: longer than a radio unit takes to pass a message on."""

    @model_validator(mode="after")
    def _leaves_no_sooner_than_it_joins(self) -> Self:
        if self.leave_headway_s < self.join_headway_s:
            raise ValueError(
                f"leave_headway_s must not be below join_headway_s ({self.join_headway_s})"
            )
        return self

    def parameters(self) -> GroupParameters:
        """The parameters of the protocol with these settings."""
        return replace(DEFAULTS, **dict(self))
