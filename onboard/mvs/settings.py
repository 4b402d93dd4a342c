"""Settings of MVS that a user can judge."""

from enum import StrEnum

from pydantic import Field

from onboard.messages.bsm import MAX_FOOTER_BYTES
from onboard.settings import Settings


class Selection(StrEnum):
    """Method of choosing what to broadcast (section V-A)."""

    MVS = "mvs"
    """Algorithm 1 of the paper."""
    MEASUREMENTS_ONLY = "mo"
    """The paper's first baseline: measurements at random, no estimates."""
    RANDOM = "rs"
    """The paper's second baseline: one measurement or estimate a vehicle, vehicles at random."""


class SharedIn(StrEnum):
    """What carries measurements to other vehicles."""

    FOOTER = "footer"
    """The MVS footer of the BSM: measurements and estimates, with their provenance."""
    SDSM = "sdsm"
    """SAE J3224: own measurements, which receivers of other makes read too."""
    BOTH = "both"


class SensingSettings(Settings):
    """From the camera's detections to measurements."""

    camera_ahead_m: float = Field(0.0, ge=-10.0, le=10.0)
    """Camera ahead of the point that the GNSS receiver reports."""
    face_to_centre_m: float = Field(2.2, ge=0.0, le=10.0)
    """From the side of a vehicle that the sensor measures to the vehicle's centre."""
    face_to_centre_sigma_m: float = Field(0.5, ge=0.0, le=5.0)
    """Vehicles differ in length, and are not always measured from behind."""
    heading_sigma_rad: float = Field(0.02, gt=0.0, le=0.5)
    """Angle between the camera's axis and the course: error of mounting, and sideslip."""
    velocity_sigma_m_s: float = Field(0.1, gt=0.0, le=2.0)
    """Error of the GNSS receiver's velocity on either axis, by its data sheet."""


class MvsSettings(Settings):
    """Shared sensing of vehicles without a radio."""

    shared_in: SharedIn = SharedIn.FOOTER
    selection: Selection = Selection.MVS
    max_entries: int = Field(10, ge=0, le=64)
    """M: measurements and estimates in one footer or SDSM; with 0 nothing is shared."""
    max_bytes: int = Field(MAX_FOOTER_BYTES, ge=18, le=MAX_FOOTER_BYTES)
    """Size of the footer; the default is what BSM and signature leave of a WSM."""
    sensing: SensingSettings = SensingSettings()
