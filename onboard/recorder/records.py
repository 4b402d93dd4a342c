"""Records of the black box, besides the inputs and outputs of the cores.

The topic is `/in/<kind>` for inputs, `/out/<kind>` for outputs.
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
    """The ID of a plate in an epoch, for replays, which have neither plate nor key."""

    kind: ClassVar[str] = "identity"
    stamp_s: float
    plate: str
    """Its alias, or the plate if plates are recorded in clear."""
    epoch: int
    car_id: bytes


@dataclass(frozen=True, slots=True)
class EntropyInput:
    """The seed of all random draws from a change of the pseudonym on; recorded only then."""

    kind: ClassVar[str] = "entropy_input"
    stamp_s: float
    entropy: bytes


@dataclass(frozen=True, slots=True)
class RecordingGap:
    """Records are missing here: the disk was full or too slow."""

    kind: ClassVar[str] = "recording_gap"
    stamp_s: float
    dropped: int


@dataclass(frozen=True, slots=True)
class CameraImage:
    """One image of the camera."""

    kind: ClassVar[str] = "camera_image"
    stamp_s: float
    jpeg: bytes


@dataclass(frozen=True, slots=True)
class RecorderState:
    """Whether the black box records; for the trace and the driver's page, not recorded itself."""

    kind: ClassVar[str] = "recorder"
    stamp_s: float
    is_recording: bool
    reason: str
    """Why it does not record; empty while it does."""
    dropped: int
    """Number of records lost since the start."""


@dataclass(frozen=True, slots=True)
class RecordedMessage:
    """One record: a value with its topic and UTC time."""

    topic: str
    utc_s: float
    value: Event
