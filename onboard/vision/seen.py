"""What the camera's edge puts out for each frame; it crosses from a process to another."""

from dataclasses import dataclass

from onboard.observations import (
    Discarded,
    Lead,
    Plate,
    SensorImpaired,
    SensorLost,
    SensorRecovered,
    VehicleDetection,
)

Event = (
    Plate | Lead | VehicleDetection | Discarded | SensorImpaired | SensorLost | SensorRecovered
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Picture:
    """An image of the camera for the black box."""

    stamp_s: float
    jpeg: bytes


@dataclass(frozen=True, slots=True)
class Seen:
    """What perception puts out for one frame, and the frame itself if it is to be recorded."""

    events: tuple[Event, ...] = ()
    picture: Picture | None = None


@dataclass(frozen=True, slots=True)
class PictureRate:
    """Which frames are to be recorded."""

    hz: float
    quality: int
    """Of their JPEG, 1 to 100."""
