"""Replays CAN logs, video clips, GNSS logs and captures of WSMs through the cores."""

import heapq
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
import numpy.typing as npt

from onboard.errors import UserError
from onboard.gnss.gnss_log import read_gnss_log
from onboard.obd.can_log import read_can_log
from onboard.obd.dbc_file import read_signals
from onboard.observations import Discarded, Sensor
from onboard.security.key_files import read_own_credentials
from onboard.settings import parse_settings
from onboard.step import Input, ReceivedWsm
from onboard.trace.trace_line import Event
from onboard.vehicle.config import CarConfig, CarSettings
from onboard.vehicle.stack import Stack
from onboard.vision.camera import open_recorded
from onboard.vision.networks import load_perception
from onboard.vision.settings import CameraSettings
from onboard.wave_udp.capture import OWN_MAC, CaptureError, Packet, read_capture

LONGEST_PAUSE_S = 86_400.0
"""Longest gap between two inputs in s; a vehicle may be parked overnight in a recording."""

UNCONFIGURED = CarConfig(car=CarSettings(plate="REPLAY"))
"""Configuration of a replay that is given none."""

_Stamped = tuple[float, int, Input]
"""Time in s, number of the source (which orders inputs of one time), and the input."""


@dataclass(frozen=True, slots=True)
class RawRecording:
    """Raw sensor recordings of a drive, each optional."""

    can: Path | None = None
    """CAN log in any format that python-can reads."""
    clip: str | None = None
    """A video, or a folder or glob of images."""
    fps: float | None = None
    """Frame rate in Hz; needed for images, and for videos that state a wrong rate."""
    gnss: Path | None = None
    """A GNSS receiver's NMEA sentences or binary log, or gpsd's reports."""
    pcap: Path | None = None
    """A capture of WSMs (pcap or pcapng), stamped in UTC."""

    def sensors(self) -> frozenset[Sensor]:
        """Return the recorded sensors."""
        recordings = {
            Sensor.SPEED: self.can,
            Sensor.CAMERA: self.clip,
            Sensor.POSITION: self.gnss,
            Sensor.RADIO: self.pcap,
        }
        return frozenset(sensor for sensor, recorded in recordings.items() if recorded is not None)


def replay(recording: RawRecording, config: CarConfig) -> Iterator[Event]:
    """Yield the observations and decisions of the cores, in order of time.

    All but a clip have time stamps: it starts with the first CAN frame, else with the first fix,
    else with the first WSM, else at 0.

    Raises:
        UserError: a file has nothing to replay or cannot be read, or inputs are more than
            `LONGEST_PAUSE_S` apart.
    """
    inputs = _inputs(recording, config)
    first = next(inputs, None)
    if first is None:
        raise UserError(f"{recording.clip}: nothing to replay: no readable image")
    credentials = None
    if recording.pcap:
        credentials = read_own_credentials(config.security, config.car.plate, config.psids)
    # No OBD requests: the recording holds the requests of the drive and their responses.
    listening = config.obd.model_copy(update={"polling_hz": None})
    stack = Stack(
        config.model_copy(update={"obd": listening}),
        recording.sensors(),
        np.random.default_rng(config.seed or 0),
        now=first[0],
        utc_s=first[0],
        credentials=credentials,
        signals=read_signals(config.obd.broadcast),
    )
    now = first[0]
    for stamp_s, _, received in chain((first,), inputs):
        if stamp_s - now > LONGEST_PAUSE_S:
            raise UserError(
                f"the recording jumps from {now:.0f} to {stamp_s:.0f} s: its files must be of one"
                " drive and use one clock"
            )
        while (at := stack.get_timer()) <= stamp_s:
            now = max(now, at)
            yield from stack.step((), now).events
        now = max(now, stamp_s)
        yield from stack.step((received,), now).events


def in_real_time(events: Iterator[Event]) -> Iterator[Event]:
    """Yield the events at the speed of the drive."""
    offset_s = None
    for event in events:
        if offset_s is None:
            offset_s = time.monotonic() - event.stamp_s
        time.sleep(max(0.0, event.stamp_s + offset_s - time.monotonic()))
        yield event


def _inputs(recording: RawRecording, config: CarConfig) -> Iterator[_Stamped]:
    """Yield the inputs of all recordings in order of time."""
    stamped = (
        (recording.can, _from_can, "CAN frame"),
        (recording.gnss, _from_gnss, "fix"),
        (recording.pcap, _from_capture, "WSM of another vehicle"),
    )
    sources: list[Iterator[_Stamped]] = []
    begins_s: list[float] = []
    for path, read, what in stamped:
        if path is not None:
            source = read(path)
            first = next(source, None)
            if first is None:
                raise UserError(f"{path}: nothing to replay: no readable {what}")
            begins_s.append(first[0])
            sources.append(chain((first,), source))
    if recording.clip is not None:
        begin_s = begins_s[0] if begins_s else 0.0
        sources.append(_from_clip(recording.clip, recording.fps, config, begin_s))
    return heapq.merge(*sources, key=lambda each: each[:2])


def _from_can(path: Path) -> Iterator[_Stamped]:
    unreadable: list[Discarded] = []
    for frame in read_can_log(path, on_discarded=unreadable.append):
        while unreadable:
            yield frame.stamp_s, 0, unreadable.pop(0)
        yield frame.stamp_s, 0, frame
    for discarded in unreadable:  # after the last frame
        yield discarded.stamp_s, 0, discarded


def _from_clip(
    clip: str, fps: float | None, config: CarConfig, start_s: float
) -> Iterator[_Stamped]:
    calibration = config.camera.model_dump() if config.camera is not None else {}
    given = calibration | {"source": clip, "fps": fps}
    camera = parse_settings(given, CameraSettings, "onboard replay")
    frames = open_recorded(camera)
    perception = load_perception(camera, config.vision)
    for number, frame in enumerate(frames):
        if number == 0 and config.camera is not None:
            _check_shape(clip, frame.image, camera)
        perception.receive_frame(frame.image, start_s + frame.stamp_s)
        while (observation := perception.next_event()) is not None:
            yield observation.stamp_s, 1, observation


def _check_shape(clip: str, image: npt.NDArray[np.uint8], camera: CameraSettings) -> None:
    """Raise a `UserError` if the calibration is of images of another shape."""
    height_px, width_px = image.shape[:2]
    if image.size and camera.for_size(width_px, height_px) is None:
        raise UserError(
            f"{clip}: its images of {width_px} x {height_px} px have another shape than "
            f"camera.width_px and height_px, {camera.width_px} x {camera.height_px}"
        )


def _from_gnss(path: Path) -> Iterator[_Stamped]:
    for event in read_gnss_log(path):
        yield event.stamp_s, 2, event


def _from_capture(path: Path) -> Iterator[_Stamped]:
    for packet in received_packets(path):
        assert packet.message is not None  # noqa: S101 (those are left out)
        yield packet.utc_s, 3, ReceivedWsm(packet.utc_s, packet.message)


def received_packets(path: Path) -> Iterator[Packet]:
    """Yield the packets of a capture that have a message, but those that the host vehicle sent.

    Raises:
        UserError: it cannot be read.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    try:
        for packet in read_capture(data):
            if packet.message is not None and packet.sender != OWN_MAC:
                yield packet
    except CaptureError as error:
        raise UserError(f"{path}: {error}") from error
