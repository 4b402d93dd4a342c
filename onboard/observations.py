"""Observations: the frozen values that packages exchange, with unit, time stamp and source.

`stamp_s` is the time of the measurement in s, on the clock of the cores' `now`. `kind` is the name
of the class in traces and recordings.
"""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import ClassVar, Literal


class Sensor(StrEnum):
    """Inputs whose loss is reported."""

    SPEED = "speed"
    CAMERA = "camera"
    POSITION = "position"
    RADIO = "radio"
    DETECTOR = "detector"


@dataclass(frozen=True, slots=True)
class Speed:
    """Speed of the host vehicle, as its bus reports it."""

    kind: ClassVar[str] = "speed"
    stamp_s: float
    speed_m_s: float
    resolution_m_s: float
    """Resolution of the source: 1 km/h for OBD PID 0x0D."""
    source: str
    """`obd:<ECU response id in hex>` or `dbc:<message>.<signal>`."""


@dataclass(frozen=True, slots=True)
class BrakePedal:
    """Whether the brake pedal is pressed, from a broadcast signal."""

    kind: ClassVar[str] = "brake_pedal"
    stamp_s: float
    pressed: bool
    source: str


Side = Literal["left", "right"]
"""Of the vehicle."""


@dataclass(frozen=True, slots=True)
class TurnSignal:
    """Whether the turn signal of one side is on, from a broadcast signal; a lamp's one blinks."""

    kind: ClassVar[str] = "turn_signal"
    stamp_s: float
    side: Side
    is_on: bool
    source: str


@dataclass(frozen=True, slots=True)
class YawRate:
    """How fast the host vehicle turns, from a broadcast signal."""

    kind: ClassVar[str] = "yaw_rate"
    stamp_s: float
    yaw_rate_rad_s: float
    """Positive to the right."""
    source: str


@dataclass(frozen=True, slots=True)
class Steering:
    """Curvature of the circle that the front wheels are steered on, from a broadcast signal."""

    kind: ClassVar[str] = "steering"
    stamp_s: float
    curvature_1_m: float
    """Positive to the right."""
    source: str


@dataclass(frozen=True, slots=True)
class Curvature:
    """Curvature of the host vehicle's path, by all that measures it."""

    kind: ClassVar[str] = "curvature"
    stamp_s: float
    curvature_1_m: float
    """Positive to the right."""
    sigma_1_m: float


class BrakeCause(StrEnum):
    """What shows that the host vehicle brakes hard, the least severe first."""

    TEST = "test"
    """The driver's button: nothing brakes."""
    DECELERATION = "deceleration"
    """The speed falls as in hard braking."""
    BRAKE_PRESSURE = "brake_pressure"
    HAZARD_LIGHTS = "hazard_lights"
    """Switched on by the vehicle while it brakes."""
    STABILITY_CONTROL = "stability_control"
    ABS = "abs"
    COLLISION = "collision"
    """The speed falls faster than tyres can brake."""
    AIRBAG = "airbag"


@dataclass(frozen=True, slots=True)
class HardBrake:
    """Hard braking of the host vehicle: it begins, its level or cause changes, or it is over.

    The first one after none or after one that is over begins it.
    """

    kind: ClassVar[str] = "hard_brake"
    stamp_s: float
    """Of the sample that shows the change."""
    deceleration_m_s2: float
    """Positive while braking; 0 when it is over."""
    source: str
    cause: BrakeCause = BrakeCause.DECELERATION
    is_over: bool = False


@dataclass(frozen=True, slots=True)
class ImageBox:
    """Axis-aligned rectangle in an image, in pixels from the top left corner."""

    x_px: float
    y_px: float
    w_px: float
    h_px: float

    @property
    def centre_px(self) -> tuple[float, float]:
        """Centre (x, y)."""
        return self.x_px + self.w_px / 2, self.y_px + self.h_px / 2


@dataclass(frozen=True, slots=True)
class Plate:
    """A plate or AR tag detected in one frame."""

    kind: ClassVar[str] = "plate"
    stamp_s: float
    box: ImageBox
    text: str | None
    """Upper case without separators; `None` if it could not be read."""
    confidence: float
    """Of the text, 0 to 1; 0 without a text."""
    is_lead: bool


class LeadIdentity(StrEnum):
    """Whether there is a lead vehicle, and whether its plate is known."""

    NO_LEAD = "no_lead"
    """The lane was seen to be free."""
    UNKNOWN = "unknown"
    """A vehicle whose plate is not known; without a gap, the lane was not seen to be free."""
    KNOWN = "known"


@dataclass(frozen=True, slots=True)
class PlateCandidate:
    """A text that a plate may bear."""

    text: str
    """Upper case without separators."""
    probability: float
    """That the plate bears it, 0 to 1, by all readings of the track."""


@dataclass(frozen=True, slots=True)
class Lead:
    """The lead vehicle, tracked from frame to frame."""

    kind: ClassVar[str] = "lead"
    stamp_s: float
    identity: LeadIdentity
    text: str | None = None
    """The voted plate, only with `LeadIdentity.KNOWN`."""
    gap_m: float | None = None
    """From the camera to the rear of the lead vehicle, along the lane; `None` without one."""
    gap_sigma_m: float | None = None
    closing_speed_m_s: float | None = None
    """Positive while the gap shrinks."""
    closing_speed_sigma_m_s: float | None = None
    """Without the error of scale that it shares with the gap: a TTC has none."""
    track_id: int | None = None
    """Number of the camera's track: constant while the same vehicle is tracked, and never used
    again for another one."""
    candidates: tuple[PlateCandidate, ...] = field(default=(), metadata={"traced": False})
    """Texts that its plate may bear, the likeliest first, at most 16; what their probabilities lack
    to 1 is for all other texts."""
    box: ImageBox | None = field(default=None, metadata={"traced": False})
    """Its plate, tag or rear in the image; `None` without a gap, or where it is not seen."""


NEW_LEAD_M = 5.0
"""A larger change of the gap from one `Lead` to the next means another vehicle."""


@dataclass(frozen=True, slots=True)
class VehicleDetection:
    """A vehicle in one image or sweep, relative to the sensor (for MVS)."""

    kind: ClassVar[str] = "vehicle_detection"
    stamp_s: float
    track_id: int
    """Number of the sensor's track, constant while the vehicle is tracked."""
    range_m: float
    range_sigma_m: float
    bearing_rad: float
    """Clockwise from the host vehicle's heading."""
    bearing_sigma_rad: float
    text: str | None = None
    range_rate_m_s: float | None = None
    """Positive while the range grows; radar measures it."""
    range_rate_sigma_m_s: float | None = None
    """Known if the range rate is."""


@dataclass(frozen=True, slots=True)
class DetectionList:
    """All vehicles that a detector of the user's found in one image or sweep, possibly none.

    With such a detector, the camera's detections are not shared.
    """

    kind: ClassVar[str] = "detection_list"
    stamp_s: float
    cars: tuple[VehicleDetection, ...]
    """All with this stamp, each `track_id` once."""


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
    """Standard deviation of each horizontal axis."""
    speed_m_s: float | None
    course_rad: float | None
    """Clockwise from true north, from 0 to 2 pi."""


@dataclass(frozen=True, slots=True)
class SensorLost:
    """A sensor has timed out, or its component reports it as lost."""

    kind: ClassVar[str] = "sensor_lost"
    stamp_s: float
    sensor: Sensor
    silent_s: float | None
    """Since its last valid sample; `None` if there never was one."""
    reason: str


class Impairment(StrEnum):
    """What makes the measurements of a sensor at work worse."""

    TURNED = "turned"
    """The camera does not look where its calibration says."""
    DIRTY = "dirty"
    """Parts of the horizon ahead stay without edges: behind dirt, or in fog."""
    BLURRED = "blurred"
    OVER_EXPOSED = "over_exposed"


@dataclass(frozen=True, slots=True)
class SensorImpaired:
    """What impairs a sensor that is at work, each time that it changes."""

    kind: ClassVar[str] = "sensor_impaired"
    stamp_s: float
    sensor: Sensor
    impairments: tuple[Impairment, ...]
    """Empty once nothing does."""


@dataclass(frozen=True, slots=True)
class SensorRecovered:
    """A lost sensor has sent a valid sample."""

    kind: ClassVar[str] = "sensor_recovered"
    stamp_s: float
    sensor: Sensor


@dataclass(frozen=True, slots=True)
class Discarded:
    """Bytes or a message from outside that were dropped; counted by `reason`."""

    kind: ClassVar[str] = "discarded"
    stamp_s: float
    component: str
    """Which package dropped it: `obd`, `vision`, `wsmp`, `security`, `lcca`, ..."""
    reason: str
    """A short constant word, usable as label of a metric."""
    detail: str = ""
    """What exactly was wrong, as text."""
