"""The frozen values that cross rooms: value, unit, stamp, source, validity.

`stamp_s` is when the thing was measured, in seconds on the clock that the cores are given as
`now`. Every class names its `kind`, the word under which a trace line carries it.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar


class Sensor(StrEnum):
    """What a car can lose."""

    SPEED = "speed"
    CAMERA = "camera"
    POSITION = "position"
    RADIO = "radio"
    DETECTOR = "detector"


@dataclass(frozen=True, slots=True)
class Speed:
    """The car's own speed over ground as its bus reports it."""

    kind: ClassVar[str] = "speed"
    stamp_s: float
    speed_m_s: float
    resolution_m_s: float
    """Step of the source's scale: 1 km/h for OBD PID 0x0D."""
    source: str
    """`obd:<ECU response id in hex>` or `dbc:<message>.<signal>`."""


@dataclass(frozen=True, slots=True)
class BrakePedal:
    """Whether the brake pedal is pressed, from a signal that the car broadcasts."""

    kind: ClassVar[str] = "brake_pedal"
    stamp_s: float
    pressed: bool
    source: str


@dataclass(frozen=True, slots=True)
class HardBrake:
    """The own car decelerates by more than the threshold; raised once per braking."""

    kind: ClassVar[str] = "hard_brake"
    stamp_s: float
    """Stamp of the sample that gave certainty."""
    deceleration_m_s2: float
    """Positive while braking."""
    source: str


@dataclass(frozen=True, slots=True)
class ImageBox:
    """An upright rectangle in the picture, in pixels from the top left corner."""

    x_px: float
    y_px: float
    w_px: float
    h_px: float

    @property
    def centre_px(self) -> tuple[float, float]:
        """(x, y) of the middle."""
        return self.x_px + self.w_px / 2, self.y_px + self.h_px / 2


@dataclass(frozen=True, slots=True)
class Plate:
    """One plate or AR tag seen in one frame."""

    kind: ClassVar[str] = "plate"
    stamp_s: float
    box: ImageBox
    text: str | None
    """Characters without separators, upper case; `None` where they could not be read."""
    confidence: float
    """Of the text, 0 to 1; 0 where `text` is `None`."""
    is_lead: bool


class LeadIdentity(StrEnum):
    """What is known of the car ahead in the own lane. Three different things to say."""

    NO_LEAD = "no_lead"
    UNKNOWN = "unknown"
    KNOWN = "known"


@dataclass(frozen=True, slots=True)
class Lead:
    """The car ahead in the own lane, tracked from frame to frame."""

    kind: ClassVar[str] = "lead"
    stamp_s: float
    identity: LeadIdentity
    text: str | None = None
    """The voted plate, only with `LeadIdentity.KNOWN`."""
    gap_m: float | None = None
    """Camera to the rear of the lead car, along the lane; `None` without a lead."""
    gap_sigma_m: float | None = None
    closing_speed_m_s: float | None = None
    """Positive while the gap shrinks."""
    closing_speed_sigma_m_s: float | None = None


NEW_LEAD_M = 5.0
"""A gap that jumps by more from one `Lead` to the next is the gap to another car."""


@dataclass(frozen=True, slots=True)
class VehicleDetection:
    """Any car in the camera's view, relative to the camera (for MVS)."""

    kind: ClassVar[str] = "vehicle_detection"
    stamp_s: float
    track_id: int
    """The observer's own name for it, stable while it is tracked."""
    range_m: float
    range_sigma_m: float
    bearing_rad: float
    """Clockwise from the car's heading, as headings are."""
    bearing_sigma_rad: float
    text: str | None = None


@dataclass(frozen=True, slots=True)
class DetectionList:
    """All cars that a detector of the user's found in one picture; to find none says that it looks.

    Where there is such a detector, what the own vision senses by plates is not shared besides.
    """

    kind: ClassVar[str] = "detection_list"
    stamp_s: float
    cars: tuple[VehicleDetection, ...]
    """All of this stamp, each `track_id` once."""


@dataclass(frozen=True, slots=True)
class Position:
    """A fix of the GNSS receiver, WGS 84."""

    kind: ClassVar[str] = "position"
    stamp_s: float
    latitude_deg: float
    longitude_deg: float
    altitude_m: float | None
    """Above the ellipsoid."""
    sigma_m: float
    """One standard deviation, horizontal, per axis."""
    speed_m_s: float | None
    course_rad: float | None
    """Clockwise from true north."""


@dataclass(frozen=True, slots=True)
class SensorLost:
    """A sensor has been silent (or frozen) for longer than its limit."""

    kind: ClassVar[str] = "sensor_lost"
    stamp_s: float
    sensor: Sensor
    silent_s: float | None
    """Since its last valid sample; `None` if there never was one."""
    reason: str


@dataclass(frozen=True, slots=True)
class SensorRecovered:
    """A lost sensor delivers again."""

    kind: ClassVar[str] = "sensor_recovered"
    stamp_s: float
    sensor: Sensor


@dataclass(frozen=True, slots=True)
class Discarded:
    """Bytes or a message from outside that were not believed; counted by `reason`."""

    kind: ClassVar[str] = "discarded"
    stamp_s: float
    component: str
    """Who dropped it: `obd`, `vision`, `wsmp`, `security`, `lcca`, ..."""
    reason: str
    """A short stable word, fit for a counter's label."""
    detail: str = ""
    """For people: what exactly was wrong."""
