"""Settings of the cameras, control units, GNSS receivers and detectors of a scenario's cars."""

from collections.abc import Mapping
from typing import Annotated, Self

from pydantic import Field, model_validator

from onboard.settings import Settings
from sim_rig.scenario.setting_types import by_name


class LensSettings(Settings):
    """Lens of every car's plate camera; the image is 16:9."""

    width_px: int = Field(640, ge=160, le=3840, multiple_of=16)
    """Width of the image."""
    focal_px: float = Field(1600.0, ge=200.0, le=20_000.0)
    """Focal length. The default has a field of view of 23 degrees for reading plates: a European
    plate is 55 px wide at 15 m, and two cores are enough for four daemons."""
    rate_hz: float = Field(10.0, ge=2.0, le=30.0)
    """Pictures a second. Half of them cost rig and daemons half of the processor's time."""


class EcuSettings(Settings):
    """Control unit that tells every car its speed."""

    refresh_s: float = Field(0.0, ge=0.0, le=1.0)
    """Interval at which it takes a new speed, each at a time of its own; 0 for with each answer."""
    answer_s: float = Field(0.004, gt=0.0, le=0.05)
    """Time to its answer; the standard allows 0.05 s (ISO 15765-4, P2 CAN)."""


class ReceiverSettings(Settings):
    """GNSS receiver and its errors; all cars of a scenario have the same model."""

    rate_hz: float = Field(10.0, ge=1.0, le=20.0)
    """Fixes a second."""
    latency_s: float = Field(0.08, ge=0.0, le=0.5)
    """From the time of a fix to its first byte on the line."""
    bias_sigma_m: float = Field(0.7, ge=0.0, le=20.0)
    """Standard deviation of the slowly varying error (orbits, atmosphere, multipath) of each
    horizontal axis; twice that in height."""
    bias_shared: float = Field(0.6, ge=0.0, le=1.0)
    """Share of the bias variance that is common to all receivers: satellites and atmosphere are
    common, multipath is not."""
    bias_time_s: float = Field(60.0, gt=0.0, le=3600.0)
    """Correlation time of the bias: 1/e remains after it (first-order Gauss-Markov process)."""
    noise_sigma_m: float = Field(0.2, ge=0.0, le=10.0)
    """Standard deviation of the white error of each horizontal axis; twice that in height."""
    speed_sigma_m_s: float = Field(0.1, ge=0.0, le=5.0)
    """Standard deviation of the velocity of each horizontal axis, from which the course is
    computed."""


class VehicleCameraSettings(Settings):
    """Sensor with a vehicle detector: a camera, or a radar, which measures range rates too."""

    view_deg: float = Field(90.0, ge=5.0, lt=180.0)
    """Horizontal field of view, centred straight ahead."""
    rate_hz: float = Field(10.0, ge=1.0, le=50.0)
    """Images or sweeps a second."""
    sight_m: float = Field(80.0, gt=5.0, le=200.0)
    """Largest range of a detection."""
    range_sigma: float = Field(0.05, ge=0.0, le=0.5)
    """Range error as a share of the range; a fifth of its variance is constant per car."""
    range_sigma_m: float = Field(0.0, ge=0.0, le=10.0)
    """Added to it at any range."""
    bearing_sigma_rad: float = Field(0.005, gt=0.0, le=0.1)
    misses: float = Field(0.1, ge=0.0, lt=1.0)
    """Share of the images in which an unoccluded car is not detected."""
    false_detections_per_s: float = Field(0.2, ge=0.0, le=10.0)
    """Rate of detections without a car, each in one image."""
    hidden_share: float = Field(0.5, gt=0.0, le=1.0)
    """A car is not detected if nearer cars occlude at least this share of its width."""
    range_rate_sigma_m_s: float | None = Field(None, gt=0.0, le=5.0)
    """Error of the range rate; without it none is measured."""
    rear_only: bool = False
    """Whether only cars that show their rear plate, up to 60 degrees aslant, are detected."""

    @model_validator(mode="after")
    def _has_a_range_error(self) -> Self:
        if not self.range_sigma + self.range_sigma_m > 0.0:
            raise ValueError("range_sigma and range_sigma_m are both 0; one must be above")
        return self


SENSOR_PROFILES: Mapping[str, VehicleCameraSettings] = {
    "plate-camera": VehicleCameraSettings(view_deg=23.0, sight_m=40.0, rear_only=True),
    "camera-60": VehicleCameraSettings(view_deg=90.0, sight_m=60.0),
    "lidar-120": VehicleCameraSettings(
        view_deg=120.0, sight_m=120.0, range_sigma=0.0, range_sigma_m=0.1, bearing_sigma_rad=0.002
    ),
    "radar-150": VehicleCameraSettings(
        view_deg=40.0, sight_m=150.0, range_sigma=0.0, range_sigma_m=0.25, bearing_sigma_rad=0.01,
        range_rate_sigma_m_s=0.1, misses=0.05, rate_hz=20.0,
    ),
    "corner-radar-80": VehicleCameraSettings(
        view_deg=150.0, sight_m=80.0, range_sigma=0.0, range_sigma_m=0.25, bearing_sigma_rad=0.02,
        range_rate_sigma_m_s=0.1, misses=0.05, rate_hz=20.0,
    ),
}  # fmt: skip
"""Sensors by range and field of view. `plate-camera` is the one that ships: the rear plates in its
lens, as far as they are read. Errors of lidar and radars are typical of data sheets;
`corner-radar-80` is both front corner radars of a vehicle together."""

DetectorProfile = Annotated[VehicleCameraSettings, by_name("sensor profile", SENSOR_PROFILES)]
"""Settings of a detector, or the name of a profile."""
