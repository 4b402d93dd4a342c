"""Repeats the steps of a recording, and compares their outputs with the recorded ones.

Decisions are compared exactly, numbers within a tolerance, since another processor may round the
last digit differently. Signatures are not compared: a recording holds no private key.
"""

import json
import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

from onboard.errors import UserError
from onboard.its_g5.headers import BASIC
from onboard.recorder.inputs import as_input
from onboard.recorder.reader import RecordedDrive, RecordingError
from onboard.recorder.records import (
    EntropyInput,
    Identity,
    RecordedMessage,
    RecordingGap,
    StepEnd,
)
from onboard.replay.recorded_stack import replayed_stack
from onboard.replay.tap import Tap
from onboard.security import ieee1609dot2
from onboard.step import Input
from onboard.trace.trace_line import Event, as_json, as_record
from onboard.wave_udp import wsmp

OTHER_PROCESSOR: Final = 1e-9
"""Relative difference of numbers that another processor's last digits explain."""
_SIGNATURE_BYTES = 64
"""r and s, at the end of signed data, which is at the end of its WSM."""


@dataclass(frozen=True, slots=True)
class Output:
    """One output of the cores."""

    topic: str
    data: bytes
    """JSON."""


@dataclass(slots=True)
class RecordedStep:
    """One step of the drive, with its recorded and its replayed outputs."""

    at_s: float
    """Time since the start of the drive in s."""
    events: list[Event]
    """Events of the replayed step."""
    replayed: list[Output]
    """Outputs of the replay, without events that only repeat an input."""
    recorded: list[Output] = field(default_factory=list)
    """Outputs of the drive."""


@dataclass(frozen=True, slots=True)
class Difference:
    """The first output that differs from the recorded one."""

    at_s: float
    """Time since the start of the drive in s."""
    recorded: Output | None
    replayed: Output | None
    """`None` if the replay has one output fewer; likewise `recorded`."""


@dataclass(frozen=True, slots=True)
class ReplayComparison:
    """How far a replay equals its recording."""

    outputs: int
    """Number of equal outputs."""
    until_s: float
    """Time since the start of the drive in s."""
    difference: Difference | None
    gap: RecordingGap | None
    """First gap in the recording, which ends the comparison."""
    rounded: int = 0
    """Number of the equal outputs with a number whose last digits differ."""


class GapError(RecordingError):
    """The recording has a gap."""

    def __init__(self, gap: RecordingGap) -> None:
        super().__init__(f"{gap.dropped} records are missing: the disk was full or too slow")
        self.gap = gap


class _DrawnWithinSteps:
    """What the cores asked for within steps; also recorded between a step and its outputs."""

    def __init__(self) -> None:
        self.car_ids: dict[tuple[str, int], bytes] = {}
        self.entropies: deque[bytes] = deque()

    def receive_record(self, value: Identity | EntropyInput) -> None:
        if isinstance(value, Identity):
            self.car_ids[value.plate, value.epoch] = value.car_id
        else:
            self.entropies.append(value.entropy)


def play(drive: RecordedDrive) -> Iterator[RecordedStep]:
    """Step new cores with the inputs of a recording, from its first segment on.

    Raises:
        GapError: at the first gap of the recording.
        UserError: an input cannot be read.
    """
    drawn = _DrawnWithinSteps()
    records: list[RecordedMessage] = []
    tap: Tap | None = None
    inputs: list[Input] = []
    current: RecordedStep | None = None
    for entry in drive.entries():
        if entry.topic.startswith("/out/"):
            if current is not None:
                current.recorded.append(Output(entry.topic, entry.data))
            continue
        if not entry.topic.startswith(("/in/", "/recorder/")):
            continue
        try:
            value = as_input(entry)
        except UserError as error:
            raise RecordingError(f"{error}; {drive.origin()}") from error
        if isinstance(value, Identity | EntropyInput):
            drawn.receive_record(value)
            continue
        if current is not None:
            yield current
            current = None
        if isinstance(value, RecordingGap):
            raise GapError(value)
        if tap is None:
            begins = (value.stamp_s, entry.utc_s) if drive.begins_late else None
            tap = replayed_stack(
                drive.header, drawn.car_ids, drawn.entropies, records.append, begins
            )
        if isinstance(value, StepEnd):
            outputs = tap.step(inputs, value.stamp_s, value.utc_s)
            inputs = []
            replayed = [_output(record) for record in records if record.topic.startswith("/out/")]
            records.clear()
            current = RecordedStep(value.stamp_s - drive.header.now_s, outputs.events, replayed)
        else:
            inputs.append(value)
    if current is not None:
        yield current


def compare(drive: RecordedDrive, tolerance: float = OTHER_PROCESSOR) -> ReplayComparison:
    """Replay until an output differs, or to the end.

    Args:
        drive: the recording.
        tolerance: relative difference allowed between numbers.

    Raises:
        RecordingError: the recording starts within its drive, has segments missing, or was made
            without positions.
    """
    _require_whole(drive)
    outputs, until_s, rounded = 0, 0.0, 0
    before: RecordedStep | None = None
    try:
        for current in play(drive):
            if before is not None:
                difference = _first_difference(before, tolerance)
                if difference is not None:
                    return ReplayComparison(outputs, until_s, difference, None, rounded)
                outputs, until_s = outputs + len(before.recorded), before.at_s
                rounded += _rounded(before)
            before = current
    except GapError as error:
        return ReplayComparison(outputs, until_s, None, error.gap, rounded)
    if before is None:
        raise RecordingError("nothing to compare: the recording was cut off before the first step")
    # The last step may have been cut off; only its recorded outputs count.
    before.replayed = before.replayed[: len(before.recorded)]
    difference = _first_difference(before, tolerance)
    if difference is not None:
        return ReplayComparison(outputs, until_s, difference, None, rounded)
    rounded += _rounded(before)
    return ReplayComparison(outputs + len(before.recorded), before.at_s, None, None, rounded)


def _require_whole(drive: RecordedDrive) -> None:
    if not drive.header.is_complete:
        raise RecordingError("recorded without positions, on which decisions depend")
    if drive.begins_late:
        raise RecordingError("starts within its drive: earlier inputs are missing")
    if drive.missing:
        raise RecordingError(f"segments are missing: {', '.join(map(str, drive.missing))}")


def _output(record: RecordedMessage) -> Output:
    return Output(record.topic, as_json(as_record(record.value)).encode())


def _first_difference(current: RecordedStep, tolerance: float) -> Difference | None:
    for at in range(max(len(current.recorded), len(current.replayed))):
        recorded = current.recorded[at] if at < len(current.recorded) else None
        replayed = current.replayed[at] if at < len(current.replayed) else None
        if recorded is None or replayed is None or not _is_same(recorded, replayed, tolerance):
            return Difference(current.at_s, recorded, replayed)
    return None


def _rounded(current: RecordedStep) -> int:
    """Count the outputs of a step without a difference that are equal only within the tolerance."""
    pairs = zip(current.recorded, current.replayed, strict=True)
    return sum(not _is_same(recorded, replayed, 0.0) for recorded, replayed in pairs)


def _is_same(recorded: Output, replayed: Output, tolerance: float) -> bool:
    if recorded == replayed:
        return True
    if recorded.topic != replayed.topic:
        return False
    if recorded.topic == "/out/wsm":
        return _without_signature(recorded) == _without_signature(replayed)
    if tolerance == 0.0:
        return False
    return _is_close(json.loads(recorded.data), json.loads(replayed.data), tolerance)


def _is_close(one: object, other: object, tolerance: float) -> bool:
    match one, other:
        case dict(), dict():
            return one.keys() == other.keys() and all(
                _is_close(value, other[key], tolerance) for key, value in one.items()
            )
        case list(), list():
            return len(one) == len(other) and all(
                _is_close(*pair, tolerance) for pair in zip(one, other, strict=True)
            )
        case float(), float():
            return math.isclose(one, other, rel_tol=tolerance, abs_tol=tolerance)
    return one == other


def _without_signature(replayed: Output) -> dict[str, object]:
    record: dict[str, object] = json.loads(replayed.data)
    frame = bytes.fromhex(str(record["data"]))
    is_wsm = wsmp.ethertype_of(frame) == wsmp.ETHERTYPE
    secured = wsmp.decode(frame).payload if is_wsm else frame[BASIC.size_bytes :]
    if ieee1609dot2.is_signed(secured):
        record["data"] = frame[:-_SIGNATURE_BYTES].hex()
    return record
