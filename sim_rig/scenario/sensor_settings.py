"""Settings of the cameras, control units, GNSS receivers and detectors of a scenario's cars."""

from pydantic import Field

from onboard.settings import Settings


class LensSettings(Settings):
    """Lens of every car's plate camera; the image is 16:9."""

    width_px: int = Field(640, ge=160, le=3840, multiple_of=16)
    """Width of the image."""
    focal_px: float = Field(1600.0, ge=200.0, le=20_000.0)
    """Focal length. The default has a field of view of 23 degrees for reading plates: a European
    plate is 55 px wide at 15 m, and two cores are enough for four daemons."""


class EcuSettings(Settings):
    """Control unit that tells every car its speed."""

    refresh_s: float = Field(0.0, ge=0.0, le=1.0)
    """Interval at which it takes a new speed, each at a time of its own; 0 for with each answer."""
    answer_s: float = Field(0.004, gt=0.0, le=0.05)
    """Time to its answer; the standard allows 0.05 s (ISO 15765-4, P2 CAN)."""


class ReceiverSettings(Settings):
    """GNSS receiver and its errors; all cars of a scenario have the same model."""

    rate_hz: float = Field(10.0, ge=1.0, le=20.0)
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
    """Camera with a vehicle detector that detects cars from every side."""

    view_deg: float = Field(90.0, gt=5.0, lt=180.0)
    """Horizontal field of view, centred straight ahead."""
    sight_m: float = Field(80.0, gt=5.0, le=200.0)
    """Largest range of a detection."""
    range_sigma: float = Field(0.05, gt=0.0, le=0.5)
    """Range error as a share of the range; a fifth of its variance is constant per car."""
    bearing_sigma_rad: float = Field(0.005, gt=0.0, le=0.1)
    misses: float = Field(0.1, ge=0.0, lt=1.0)
    """Share of the images in which an unoccluded car is not detected."""
    false_detections_per_s: float = Field(0.2, ge=0.0, le=10.0)
    """Rate of detections without a car, each in one image."""
    hidden_share: float = Field(0.5, gt=0.0, le=1.0)
    """A car is not detected if nearer cars occlude at least this share of its width."""
