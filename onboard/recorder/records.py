"""What the black box writes beside the values that the rooms exchange anyway.

A topic is `/in/<kind>` for a call of the cores' verbs, and `/out/<kind>` for what they said to it.
"""

from dataclasses import dataclass
from typing import ClassVar

from onboard.trace.trace_line import Event


@dataclass(frozen=True, slots=True)
class Step:
    """Ends the inputs of one moment: the cores did what was due, and were asked what they say."""

    kind: ClassVar[str] = "step"
    stamp_s: float
    """The time that all calls of the round were given as `now`."""
    utc_s: float | None
    """What the cores were told UTC is, before the inputs; `None`: nothing."""
    timer: bool
    """Whether their timer was due."""


@dataclass(frozen=True, slots=True)
class ReceivedWsm:
    """A frame from the radio."""

    kind: ClassVar[str] = "wsm"
    stamp_s: float
    data: bytes


@dataclass(frozen=True, slots=True)
class SentWsm:
    """A frame for the radio."""

    kind: ClassVar[str] = "wsm"
    stamp_s: float
    user_priority: int
    data: bytes


@dataclass(frozen=True, slots=True)
class BrakeButton:
    """Somebody pressed the brake button of the paper's demonstration."""

    kind: ClassVar[str] = "brake_button"
    stamp_s: float


@dataclass(frozen=True, slots=True)
class Identity:
    """The ID that a plate has in an epoch; a replay has neither the plate nor the key."""

    kind: ClassVar[str] = "identity"
    stamp_s: float
    plate: str
    """As the recording names it."""
    epoch: int
    car_id: bytes


@dataclass(frozen=True, slots=True)
class RecordingGap:
    """Notes are missing here: the disk was full, or slower than the car."""

    kind: ClassVar[str] = "recording_gap"
    stamp_s: float
    dropped: int


@dataclass(frozen=True, slots=True)
class CameraImage:
    """What the camera saw."""

    kind: ClassVar[str] = "camera_image"
    stamp_s: float
    jpeg: bytes


@dataclass(frozen=True, slots=True)
class RecorderState:
    """Whether the black box records. For the trace and the driver's page, not for the box."""

    kind: ClassVar[str] = "recorder"
    stamp_s: float
    is_recording: bool
    reason: str
    """Why not; empty while it does."""
    dropped: int
    """Notes lost since the start."""


@dataclass(frozen=True, slots=True)
class Record:
    """One message of the recording."""

    topic: str
    utc_s: float
    value: Event
