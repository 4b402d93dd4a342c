"""What a recorded drive puts on the wires of a car, in its own time base."""

import base64
import heapq
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, Literal

import cv2
from typing_extensions import override

from onboard.errors import UserError
from onboard.gnss.gnss_log import read_gnss_log
from onboard.messages.lcca import NO_ID, CarId
from onboard.obd.can_frame import CanFrame
from onboard.obd.can_log import read_can_log
from onboard.observations import DetectionList, Position
from onboard.recorder.inputs import as_input
from onboard.recorder.reader import Entry, RecordedDrive
from onboard.recorder.records import Identity, StepEnd
from onboard.recorder.segment import IMAGES
from onboard.step import ReceivedWsm
from onboard.tools.replay import RawRecording, received_packets
from onboard.vision.camera import open_recorded
from onboard.vision.settings import CameraSettings
from sim_rig.cars.nmea_sentences import Fix, sentences
from sim_rig.cars.vehicle_detector import datagram

Wire = Literal["bus", "radio", "satellites", "camera", "detector"]
"""The wires of a box that take inputs, by their names in its file."""
CLASSICAL_BYTES = 8
"""Longest CAN frame that the rig sends."""
RECEIVER_S = 0.1
"""From a fix to its sentences, where only the time of the fix is recorded."""
_LATE_S = 5.0
"""An input is recorded within this time."""
_JPEG_QUALITY = 95
_CAMERA_KINDS = frozenset({"lead", "plate", "vehicle_detection"})
"""What a camera's pictures have become in a black box recording."""
_OF_NO_WIRE = frozenset({"brake_button", "program_message"})


@dataclass(frozen=True, slots=True)
class PlayedInput:
    """One frame, fix, picture or list of detections."""

    at_s: float
    """When it arrived, s since the first input of the drive."""
    wire: Wire
    content: CanFrame | bytes
    """A CAN frame, a WSM, NMEA sentences, a JPEG, or a datagram of a detector."""

    @property
    def frame(self) -> CanFrame:
        """The CAN frame."""
        assert isinstance(self.content, CanFrame)  # noqa: S101 (so it is on the bus)
        return self.content

    @property
    def data(self) -> bytes:
        """What is on another wire than the bus."""
        assert isinstance(self.content, bytes)  # noqa: S101 (so it is there)
        return self.content


@dataclass(frozen=True, slots=True)
class PlayedDrive:
    """A drive to play, from a black box recording or from raw recordings."""

    stamped: Callable[[], Iterator[PlayedInput]]
    """Yields its inputs in order, on its own clock. May raise `UserError`."""
    wires: frozenset[Wire]
    """Those on which it has inputs."""
    start_s: float
    """Time of the first input on that clock."""
    start_utc_s: float | None
    """UTC of the first input; `None` if the recordings have no UTC."""
    before_s: float = 0.0
    """How long its vehicle had been at work then."""
    left_out: tuple[str, ...] = ()
    """Kinds of recorded inputs that are on no wire."""
    own_ids: frozenset[CarId] = frozenset()
    """Communication IDs of its vehicle, if they are known."""

    def inputs(self) -> Iterator[PlayedInput]:
        """Yield the inputs with times since the first one.

        Raises:
            UserError: a file cannot be read.
        """
        for each in self.stamped():
            yield PlayedInput(each.at_s - self.start_s, each.wire, each.content)


def of_black_box(drive: RecordedDrive) -> PlayedDrive:
    """Return what a black box recorded: CAN frames, WSMs, fixes, pictures and detections.

    Raises:
        UserError: nothing of it is on a wire.
    """
    topics = {entry.topic for entry in drive.entries()}
    on_wires = topics & WIRES.keys()
    kinds = {topic.removeprefix("/in/") for topic in topics - on_wires if topic.startswith("/in/")}
    seen = frozenset() if IMAGES in on_wires else _CAMERA_KINDS
    played = _played(
        lambda: _in_order(_stamped_of(drive)),
        frozenset(WIRES[topic] for topic in on_wires),
        drive.header.utc_s - drive.header.now_s,
    )
    left_out = tuple(sorted(kinds & (seen | _OF_NO_WIRE)))
    before_s = played.start_s - drive.header.now_s
    return replace(played, before_s=before_s, left_out=left_out, own_ids=own_ids(drive))


def _played(
    stamped: Callable[[], Iterator[PlayedInput]],
    wires: frozenset[Wire],
    utc_offset_s: float | None,
) -> PlayedDrive:
    first = next(stamped(), None)
    if first is None:
        raise UserError("nothing to play: no readable CAN frame, WSM, fix, picture or detection")
    start_utc_s = None if utc_offset_s is None else first.at_s + utc_offset_s
    return PlayedDrive(stamped, wires, first.at_s, start_utc_s)


def own_ids(drive: RecordedDrive) -> frozenset[CarId]:
    """Return the communication IDs of the vehicle itself in a recorded drive."""
    own = drive.header.config["car"]["plate"]
    identities = (as_input(each) for each in drive.entries() if each.topic == "/in/identity")
    return frozenset(
        each.car_id[: len(NO_ID)]
        for each in identities
        if isinstance(each, Identity) and each.plate == own
    )


class PlayedEntries(RecordedDrive):
    """A recording without what the camera saw, as a box receives it that gets no pictures."""

    @override
    def entries(self) -> Iterator[Entry]:
        """Yield every record that does not come from pictures."""
        for entry in super().entries():
            direction, _, kind = entry.topic.rpartition("/")
            if direction != "/in" or kind not in _CAMERA_KINDS:
                yield entry


WIRES: Mapping[str, Wire] = {
    "/in/can": "bus",
    "/in/wsm": "radio",
    "/in/position": "satellites",
    "/in/detection_list": "detector",
    IMAGES: "camera",
}
"""Wires of the topics of a recording."""


def _stamped_of(drive: RecordedDrive) -> Iterator[PlayedInput]:
    """Yield inputs at the end of the step that took them, and pictures at their own time."""
    utc_offset_s = drive.header.utc_s - drive.header.now_s
    waiting: list[tuple[Wire, CanFrame | bytes]] = []
    for entry in drive.entries():
        if entry.topic == IMAGES:
            jpeg = base64.b64decode(entry.record["data"])
            yield PlayedInput(entry.utc_s - utc_offset_s, "camera", jpeg)
        elif entry.topic == "/in/step":
            step = as_input(entry)
            assert isinstance(step, StepEnd)  # noqa: S101 (the kind of this topic)
            yield from (PlayedInput(step.stamp_s, wire, data) for wire, data in waiting)
            waiting.clear()
            if step.utc_s is not None:
                utc_offset_s = step.utc_s - step.stamp_s
        elif entry.topic in WIRES:
            data = _on_wire(as_input(entry), utc_offset_s)
            if data is not None:
                waiting.append((WIRES[entry.topic], data))


def _in_order(stamped: Iterable[PlayedInput]) -> Iterator[PlayedInput]:
    """Sort: a picture is recorded when the camera's process is done with it."""
    waiting: list[tuple[float, int, PlayedInput]] = []
    for number, each in enumerate(stamped):
        heapq.heappush(waiting, (each.at_s, number, each))
        while waiting[0][0] < each.at_s - _LATE_S:
            yield heapq.heappop(waiting)[-1]
    while waiting:
        yield heapq.heappop(waiting)[-1]


def _on_wire(value: Any, utc_offset_s: float) -> CanFrame | bytes | None:
    match value:
        case CanFrame():
            return value if len(value.data) <= CLASSICAL_BYTES else None
        case ReceivedWsm():
            return value.data
        case Position():
            return _sentences(value, value.stamp_s + utc_offset_s)
        case DetectionList():
            return datagram(value.cars, value.stamp_s, value.stamp_s)
    return None


def _sentences(fix: Position, utc_s: float) -> bytes:
    course_deg = None if fix.course_rad is None else math.degrees(fix.course_rad)
    return sentences(
        Fix(
            utc_s=round(utc_s, 2),
            latitude_deg=fix.latitude_deg,
            longitude_deg=fix.longitude_deg,
            height_m=fix.altitude_m,
            sigma_m=fix.sigma_m,
            speed_m_s=fix.speed_m_s,
            course_deg=course_deg,
        )
    )


def of_raw_recordings(raw: RawRecording) -> PlayedDrive:
    """Return what logs, capture and clip hold, on the clock of their stamps.

    As in `onboard replay`, a clip starts with the first CAN frame, else fix, else WSM.

    Raises:
        UserError: a file cannot be read, or nothing of it is on a wire.
    """
    given: Mapping[Wire, object] = {
        "bus": raw.can, "camera": raw.clip, "satellites": raw.gnss, "radio": raw.pcap,
    }  # fmt: skip
    wires = frozenset(wire for wire, recorded in given.items() if recorded is not None)
    played = _played(lambda: _stamped(raw), wires, 0.0)
    has_utc = played.start_s > _UTC_FROM_S
    return played if has_utc else replace(played, start_utc_s=None)


_UTC_FROM_S = 1e9
"""Smaller stamps count from the start of a recording."""


def _stamped(raw: RawRecording) -> Iterator[PlayedInput]:
    sources: list[Iterator[PlayedInput]] = []
    begins_s: list[float] = []
    for source in _sources(raw):
        first = next(source, None)
        if first is not None:
            begins_s.append(first.at_s - (RECEIVER_S if first.wire == "satellites" else 0.0))
            sources.append(chain((first,), source))
    if raw.clip is not None:
        sources.append(_pictures(raw.clip, raw.fps, begins_s[0] if begins_s else 0.0))
    yield from heapq.merge(*sources, key=lambda each: each.at_s)


def _sources(raw: RawRecording) -> Iterator[Iterator[PlayedInput]]:
    if raw.can is not None:
        yield (
            PlayedInput(frame.stamp_s, "bus", frame)
            for frame in read_can_log(raw.can)
            if len(frame.data) <= CLASSICAL_BYTES
        )
    if raw.gnss is not None:
        yield (
            PlayedInput(fix.stamp_s + RECEIVER_S, "satellites", _sentences(fix, fix.stamp_s))
            for fix in read_gnss_log(raw.gnss)
            if isinstance(fix, Position)
        )
    if raw.pcap is not None:
        yield (
            PlayedInput(packet.utc_s, "radio", packet.message or b"")
            for packet in received_packets(raw.pcap)
        )


def _pictures(clip: str, fps: float | None, start_s: float) -> Iterator[PlayedInput]:
    for frame in open_recorded(CameraSettings(source=clip, fps=fps)):
        _, jpeg = cv2.imencode(".jpg", frame.image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        yield PlayedInput(start_s + frame.stamp_s, "camera", jpeg.tobytes())


_FRAMES = frozenset({"bus", "radio"})
"""Wires whose frames arrive as they were sent."""


@dataclass(frozen=True, slots=True)
class Received:
    """One input as its receiver recorded it."""

    wire: Wire
    content: object
    """A CAN frame, a WSM; any other value has been decoded."""
    stamp_s: float


def start_on_clock_of(received: Iterable[Received], sent: Sequence[PlayedInput]) -> float | None:
    """Return when a played drive began on the clock of its receiver, s.

    Args:
        received: the first inputs that were received, in order.
        sent: the first inputs that were played, in order.

    Returns:
        the stamp of the first one that was sent too, minus its time in the drive; `None` if there
        is none.
    """
    first: dict[tuple[Wire, object], float] = {}
    for each in reversed(sent):
        key = _key(each.content) if each.wire in _FRAMES else None
        first[each.wire, key] = each.at_s
    known = ((each, first.get((each.wire, _key(each.content)))) for each in received)
    return next((each.stamp_s - at_s for each, at_s in known if at_s is not None), None)


def _key(content: object) -> object:
    """What a frame has at both ends of its wire; `None` for what a receiver decodes."""
    match content:
        case CanFrame():
            return content.arbitration_id, content.data
        case bytes():
            return content
    return None
