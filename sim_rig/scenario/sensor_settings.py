"""How good the receivers and cameras of a scenario's cars are."""

from pydantic import Field

from onboard.settings import Settings


class ReceiverSettings(Settings):
    """A GNSS receiver and its errors, the same kind in every car of a scenario."""

    rate_hz: float = Field(10.0, ge=1.0, le=20.0)
    latency_s: float = Field(0.08, ge=0.0, le=0.5)
    """From the instant of a fix to its first byte."""
    bias_sigma_m: float = Field(0.7, ge=0.0, le=20.0)
    """What orbits, air and reflections leave, on either axis; twice that in height."""
    bias_shared: float = Field(0.6, ge=0.0, le=1.0)
    """Part of its variance that all receivers around have in common: satellites and air are the
    same, reflections are each car's own."""
    bias_time_s: float = Field(60.0, gt=0.0, le=3600.0)
    """After which 1/e of a bias is left (a first-order Gauss-Markov process)."""
    noise_sigma_m: float = Field(0.2, ge=0.0, le=10.0)
    """From fix to fix, on either axis; twice that in height."""
    speed_sigma_m_s: float = Field(0.1, ge=0.0, le=5.0)
    """On either axis; the course is as uncertain as this makes it."""


class VehicleCameraSettings(Settings):
    """A camera with a vehicle detector behind it, which knows cars from every side."""

    view_deg: float = Field(90.0, gt=5.0, lt=180.0)
    """From side to side, straight ahead in the middle."""
    sight_m: float = Field(80.0, gt=5.0, le=200.0)
    range_sigma: float = Field(0.05, gt=0.0, le=0.5)
    """Share of the distance; a fifth of it never changes while a car is in view."""
    bearing_sigma_rad: float = Field(0.005, gt=0.0, le=0.1)
    misses: float = Field(0.1, ge=0.0, lt=1.0)
    """Part of the pictures in which a car in plain view is not found."""
    false_detections_per_s: float = Field(0.2, ge=0.0, le=10.0)
    """Of something that is no car, in one picture each."""
    hidden_share: float = Field(0.5, gt=0.0, le=1.0)
    """A car of whose width nearer cars hide so much is not found."""
