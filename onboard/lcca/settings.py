"""How close is too close, and how the warning group lives with a radio that loses packets."""

from typing import Self

from pydantic import Field, model_validator

from onboard.settings import Settings


class LccaSettings(Settings):
    """Distances are headways: the time in which the car drives the gap at its present speed."""

    join_headway_s: float = Field(1.98, gt=0.0, le=10.0)
    """Below this the car joins the car ahead: 0.55 m for each km/h (LCCA, section 3)."""
    leave_headway_s: float = Field(2.2, gt=0.0, le=10.0)
    """From this on it leaves. The margin keeps a noisy gap from flapping; not less than the
    headway of joining."""
    identity_dwell_s: float = Field(0.2, ge=0.0, le=2.0)
    """How long a plate must be read the same before the car under it is asked."""
    lead_hold_s: float = Field(1.0, gt=0.0, le=10.0)
    """How long a membership outlives the last frame that showed the car ahead close enough."""
    speed_hold_s: float = Field(1.0, gt=0.0, le=10.0)
    """How long a speed sample is good for. Without speed no gap is too small."""
    speed_tolerance_m_s: float = Field(5.0, gt=0.0, le=50.0)
    """How much the speed in a reply may differ from what the camera sees of the car ahead."""

    retry_s: float = Field(0.1, gt=0.0, le=5.0)
    """Until a join is repeated; doubles for a car that never answered."""
    retry_max_s: float = Field(0.25, gt=0.0, le=60.0)
    """Where the doubling ends: what a car ahead without a radio costs the channel."""
    refresh_s: float = Field(0.5, gt=0.0, le=10.0)
    """Until an answered join is refreshed."""
    spread_s: float = Field(0.02, ge=0.0, le=0.1)
    """Random delay of joins that many cars send for the same reason."""
    membership_lifetime_s: float = Field(2.5, gt=0.0, le=60.0)
    """How long either side believes in a membership without hearing of the other."""
    leader_silence_s: float = Field(3.0, gt=0.0, le=60.0)
    """How long a membership lasts without news from the leader, however well the car ahead
    answers; and so how long old news of a former leader must not be believed."""
    rename_s: float = Field(2.0, gt=0.0, le=30.0)
    """How long the previous ID of a car stays valid, and its cars ahead and behind may change
    theirs."""

    slot_s: float = Field(0.01, gt=0.0, le=0.5)
    """Of the cars that might repeat a message, each waits one more slot than the better placed."""
    acknowledge_s: float = Field(0.1, gt=0.0, le=5.0)
    """Until a warning is repeated to a follower that has not acknowledged it."""
    warn_repeats: int = Field(10, ge=0, le=50)
    """How often at most."""
    event_lifetime_s: float = Field(3.0, gt=0.0, le=60.0)
    """A warning older than this warns nobody."""

    @model_validator(mode="after")
    def _leaves_no_sooner_than_it_joins(self) -> Self:
        if self.leave_headway_s < self.join_headway_s:
            raise ValueError(
                f"leave_headway_s must not be below join_headway_s ({self.join_headway_s})"
            )
        return self
