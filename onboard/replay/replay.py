"""Makes the calls of a recording again, and compares what the cores answer with what they answered.

The comparison is exact, to the last bit of every number, with one exception: of a signed message
everything but the signature, since a recording holds no private key. Another kind of processor may
round the last digit otherwise; for its recordings a tolerance can be given.
"""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from onboard import step
from onboard.recorder.inputs import as_input
from onboard.recorder.reader import RecordedDrive, RecordingError
from onboard.recorder.records import Identity, RecordedMessage, RecordingGap, StepEnd
from onboard.replay.recorded_stack import replayed_stack
from onboard.replay.tap import Tap
from onboard.trace.trace_line import Event, as_json, as_record
from onboard.wave_udp import wsmp

_SIGNED_DATA = 0x81
"""Content choice of Ieee1609Dot2Data, its second byte."""
_SIGNATURE_BYTES = 64
"""r and s, at the end of signed data, which is at the end of its WSM."""


@dataclass(frozen=True, slots=True)
class Output:
    """One answer of the cores."""

    topic: str
    data: bytes
    """JSON."""


@dataclass(slots=True)
class RecordedStep:
    """One round of the drive."""

    at_s: float
    """Since the drive began."""
    events: list[Event]
    """What the cores see and decide now."""
    came_out: list[Output]
    """What they answer now, without the events that only repeat an input."""
    recorded: list[Output] = field(default_factory=list)
    """What they answered then."""


@dataclass(frozen=True, slots=True)
class Difference:
    """The first answer that is not the recorded one."""

    at_s: float
    """Since the drive began."""
    recorded: Output | None
    came_out: Output | None
    """`None`: there is none, where there is one on the other side."""


@dataclass(frozen=True, slots=True)
class ReplayComparison:
    """How far a replay goes along with the recording."""

    answers: int
    """That are the same."""
    until_s: float
    """Since the drive began."""
    difference: Difference | None
    gap: RecordingGap | None
    """Where notes are missing, after which nothing can be compared."""


class GapError(RecordingError):
    """Notes are missing in the recording."""

    def __init__(self, gap: RecordingGap) -> None:
        super().__init__(f"{gap.dropped} notes are missing: the disk was full or too slow")
        self.gap = gap


def play(box: RecordedDrive) -> Iterator[RecordedStep]:
    """Drive the cores with the recording, from the beginning of what there is of it.

    Raises:
        GapError: at the first place where notes are missing.
        UserError: an input cannot be read.
    """
    car_ids: dict[tuple[str, int], bytes] = {}
    notes: list[RecordedMessage] = []
    tap: Tap | None = None
    inputs: list[step.Input] = []
    moment: RecordedStep | None = None
    for entry in box.entries():
        if entry.topic.startswith("/out/"):
            if moment is not None:
                moment.recorded.append(Output(entry.topic, entry.data))
            continue
        if not entry.topic.startswith(("/in/", "/recorder/")):
            continue
        if moment is not None:
            yield moment
            moment = None
        value = as_input(entry)
        if isinstance(value, RecordingGap):
            raise GapError(value)
        if isinstance(value, Identity):
            car_ids[value.plate, value.epoch] = value.car_id
            continue
        if tap is None:
            begins = (value.stamp_s, entry.utc_s) if box.begins_late else None
            tap = replayed_stack(box.head, car_ids, notes.append, begins)
        if isinstance(value, StepEnd):
            outputs = tap.step(inputs, value.stamp_s, value.utc_s)
            inputs = []
            said = [_said(note) for note in notes if note.topic.startswith("/out/")]
            notes.clear()
            moment = RecordedStep(value.stamp_s - box.head.now_s, outputs.events, said)
        else:
            inputs.append(value)
    if moment is not None:
        yield moment


def compare(box: RecordedDrive, within: float = 0.0) -> ReplayComparison:
    """Replay until something differs, or to the end.

    Args:
        box: the recording.
        within: by how much a number may differ, as a share of it.

    Raises:
        BoxError: the recording cannot tell, since it does not begin with its drive, has segments
            missing, or was made without positions.
    """
    _require_whole(box)
    answers, until_s = 0, 0.0
    before: RecordedStep | None = None
    try:
        for moment in play(box):
            if before is not None:
                difference = _first_difference(before, within)
                if difference is not None:
                    return ReplayComparison(answers, until_s, difference, None)
                answers, until_s = answers + len(before.recorded), before.at_s
            before = moment
    except GapError as error:
        return ReplayComparison(answers, until_s, None, error.gap)
    if before is None:
        raise RecordingError("nothing to compare: the recording was cut off before the first round")
    # The last round may have been cut off; what is there of it counts.
    before.came_out = before.came_out[: len(before.recorded)]
    difference = _first_difference(before, within)
    if difference is not None:
        return ReplayComparison(answers, until_s, difference, None)
    return ReplayComparison(answers + len(before.recorded), before.at_s, None, None)


def _require_whole(box: RecordedDrive) -> None:
    if not box.head.is_complete:
        raise RecordingError(
            "recorded without positions, and so without much of what was decided from"
        )
    if box.begins_late:
        raise RecordingError(
            "begins in the middle of its drive: what was decided rests on what is gone"
        )
    if box.missing:
        raise RecordingError(f"segments are missing: {', '.join(map(str, box.missing))}")


def _said(note: RecordedMessage) -> Output:
    return Output(note.topic, as_json(as_record(note.value)).encode())


def _first_difference(moment: RecordedStep, within: float) -> Difference | None:
    for at in range(max(len(moment.recorded), len(moment.came_out))):
        recorded = moment.recorded[at] if at < len(moment.recorded) else None
        came_out = moment.came_out[at] if at < len(moment.came_out) else None
        if recorded is None or came_out is None or not _is_same(recorded, came_out, within):
            return Difference(moment.at_s, recorded, came_out)
    return None


def _is_same(recorded: Output, came_out: Output, within: float) -> bool:
    if recorded == came_out:
        return True
    if recorded.topic != came_out.topic:
        return False
    if recorded.topic == "/out/wsm":
        return _without_signature(recorded) == _without_signature(came_out)
    if within == 0.0:
        return False
    return _is_close(json.loads(recorded.data), json.loads(came_out.data), within)


def _is_close(one: object, other: object, within: float) -> bool:
    match one, other:
        case dict(), dict():
            return one.keys() == other.keys() and all(
                _is_close(value, other[key], within) for key, value in one.items()
            )
        case list(), list():
            return len(one) == len(other) and all(
                _is_close(*pair, within) for pair in zip(one, other, strict=True)
            )
        case float(), float():
            return math.isclose(one, other, rel_tol=within, abs_tol=within)
    return one == other


def _without_signature(said: Output) -> dict[str, object]:
    record: dict[str, object] = json.loads(said.data)
    frame = bytes.fromhex(str(record["data"]))
    if wsmp.decode(frame).payload[1] == _SIGNED_DATA:
        record["data"] = frame[:-_SIGNATURE_BYTES].hex()
    return record
