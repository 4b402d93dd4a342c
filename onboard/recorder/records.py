"""What the black box writes beside the values that the rooms exchange anyway.

A topic is `/in/<kind>` for a call of the cores' verbs, and `/out/<kind>` for what they said to it.
"""

from dataclasses import dataclass
from typing import ClassVar

from onboard.trace.trace_line import Event


@dataclass(frozen=True, slots=True)
class StepEnd:
    """End of the inputs of one step of the cores (`Stack.step`)."""

    kind: ClassVar[str] = "step"
    stamp_s: float
    """`now` of the step."""
    utc_s: float | None
    """UTC given to the step, in seconds since 1970; `None` if it was given none."""


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
class RecordedMessage:
    """One message of the recording."""

    topic: str
    utc_s: float
    value: Event
