"""True properties of sensors and radio in the MVS studies."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from onboard.kinematics.units import KM_H
from onboard.settings import Settings
from sim_rig.scenario.radio_settings import CsmaSettings, SidelinkSettings
from sim_rig.scenario.sensor_settings import LensSettings

FooterSize = Annotated[int, Field(ge=0, le=64)]
"""M, as `MvsSettings.max_entries` bounds it."""


class WorldSettings(Settings):
    """True properties of sensors and radio."""

    senses: bool = True
    """Whether cars with a radio have sensors."""
    sensing_range_m: float = Field(60.0, gt=0.0)
    """Range of the sensors."""
    view_deg: float = Field(360.0, gt=0.0, le=360.0)
    """Field of view, centred straight ahead."""
    rear_only: bool = False
    """Whether only cars that show their rear, up to 60 degrees aslant, are detected."""
    detection: float = Field(0.95, ge=0.0, le=1.0)
    """Probability that a car in view is detected in one tick."""
    range_sigma_m: float = Field(0.4, ge=0.0)
    """Standard deviation of a range at 0 m."""
    range_sigma_per_m: float = Field(0.01, ge=0.0)
    """Added to it, for each metre of range; one of both is above 0."""
    bearing_sigma_rad: float = Field(0.01, gt=0.0)
    """Standard deviation of a bearing."""
    range_rate_sigma_m_s: float | None = Field(None, gt=0.0)
    """Error of the range rate; without it none is measured."""
    plate_lens: LensSettings | None = None
    """Lens of a camera that reads plates, with which cars run LCCA (`mvs/lcca.py`)."""
    position_sigma_m: float = Field(0.4, gt=0.0)
    """Standard deviation of the white error of a fix, on each horizontal axis."""
    bias_sigma_m: float = Field(0.0, ge=0.0, le=20.0)
    """Standard deviation of the slowly varying error of each receiver, on each horizontal axis."""
    bias_time_s: float = Field(60.0, gt=0.0, le=3600.0)
    """Correlation time of that error (first-order Gauss-Markov process)."""
    speed_sigma_m_s: float = Field(0.1, ge=0.0)
    """Of each component of the velocity; the error of the course follows from it."""
    bus_speed_step_m_s: float = Field(KM_H, gt=0.0)
    """Resolution of the speed on the car's bus; by default that of OBD, polled in each tick."""
    reach_m: float = Field(300.0, gt=0.0)
    """Range of the radio."""
    loss: float = Field(0.0, ge=0.0, le=1.0)
    """Probability that one receiver in range loses a message."""
    csma: CsmaSettings | None = None
    """The 802.11p channel; replaces `reach_m` and `loss`."""
    sidelink: SidelinkSettings | None = None
    """C-V2X, where `csma` is not given."""
    blocker_radius_m: float = Field(0.9, ge=0.0)
    """A car occludes what lies behind a disc of this radius."""

    @model_validator(mode="after")
    def _has_a_range_error(self) -> Self:
        if not self.range_sigma_m + self.range_sigma_per_m > 0.0:
            raise ValueError("range_sigma_m and range_sigma_per_m are both 0; one must be above")
        return self
