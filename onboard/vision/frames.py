"""The camera: frames from a video, pictures, a device, or MJPEG over HTTP.

Recordings are read as fast as they are asked for, and their stamps count from 0. Live sources are
read by a thread of their own that keeps the newest picture only, so that a slow reader sees the
road as it is and not as it was; they reconnect by themselves.
"""

import http.client
import os
import re
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from email.message import Message
from functools import partial
from itertools import takewhile
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from onboard.errors import UserError
from onboard.observations import Sensor, SensorLost
from onboard.vision.jpeg import is_jpeg, is_whole
from onboard.vision.mjpeg import MjpegParts
from onboard.vision.settings import CameraSettings, VisionSettings
from onboard.vision.sight import Event, Sight

Image = npt.NDArray[np.uint8]
"""(h, w, 3), BGR; empty where a picture could not be decoded."""

DEFAULT_FPS = 25.0
LONGEST_PAUSE_S = 60.0
"""Between two frames of a video whose times are believed."""
TIMEOUT_S = 2.0
"""A live source that says nothing for this long is opened again."""
RECONNECT_S = (0.1, 2.0)
"""Pause before the first and the longest before later attempts."""
NICENESS = 10
"""Of the thread that sees."""
PICTURES = {".jpg", ".jpeg", ".png", ".bmp", ".webp", ".tif", ".tiff", ".ppm", ".pgm"}
_NO_IMAGE: Image = np.zeros((0, 0, 3), np.uint8)


class CameraError(UserError):
    """The camera cannot be opened."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One picture and when it was taken."""

    stamp_s: float
    image: Image
    name: str = ""
    """Of the file it came from."""


def open_frames(settings: CameraSettings) -> "FrameSource":
    """Open the source that the settings name.

    Raises:
        CameraError: it is not there, or is not what it should be.
    """
    source = settings.source
    if source.startswith(("http://", "https://")):
        return LiveFrames(lambda: _mjpeg_pictures(source))
    if "://" in source:
        raise CameraError(
            f"camera.source: {source}: of streams, only MJPEG by http:// or https:// is read"
        )
    if source.isdigit() or source.startswith("/dev/"):
        return LiveFrames(lambda: _device_pictures(settings))
    if pictures := _picture_files(source):
        return Pictures(pictures, settings.fps or DEFAULT_FPS)
    if not Path(source).is_file():
        raise CameraError(f"camera.source: {source}: {_why_nothing(source)}")
    return Clip(source, settings.fps)


def decode_picture(data: bytes) -> Image:
    """The picture in `data`, or an empty array.

    A JPEG without its end is not decoded: it would come out grey from where it was torn.
    """
    if is_jpeg(data) and not is_whole(data):
        return _NO_IMAGE
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        return _NO_IMAGE
    return _NO_IMAGE if image is None else np.asarray(image, np.uint8)


class Pictures:
    """Picture files as one drive."""

    live = False

    def __init__(self, files: list[tuple[str, Path]], fps: float) -> None:
        """`files`: name and path of each, in order."""
        self._files = files
        self.fps = fps
        self._closed = False

    def __iter__(self) -> Iterator[Frame]:
        for index, (name, path) in enumerate(self._files):
            if self._closed:
                return
            try:
                image = decode_picture(path.read_bytes())
            except OSError:
                image = _NO_IMAGE
            yield Frame(index / self.fps, image, name)

    def close(self) -> None:
        """End the iteration."""
        self._closed = True


class Clip:
    """A video file; its frames stand when the file says, or evenly where it cannot be believed."""

    live = False
    even_from: int | None = None
    """The first frame whose time the file does not tell, or tells wrongly, once one was met."""

    def __init__(self, source: str, fps: float | None) -> None:
        """Open `source`; `fps` overrules what it states, and lets frames stand evenly.

        Raises:
            CameraError: it is no video.
        """
        self._name = Path(source).name
        self._capture = cv2.VideoCapture(source)
        if not self._capture.isOpened():
            raise CameraError(f"camera.source: {source}: not a video that can be read")
        self.stated_frames = max(0, int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT)))
        """About how many there are, as the file says; 0 where it does not."""
        stated = self._capture.get(cv2.CAP_PROP_FPS)
        self.fps = fps or (stated if 1.0 <= stated <= 1000.0 else DEFAULT_FPS)
        self._stands_evenly = fps is not None
        self._closed = False

    def __iter__(self) -> Iterator[Frame]:
        index, stamp_s, first_s = 0, 0.0, 0.0
        while not self._closed:
            read, image = self._capture.read()
            if not read:
                break
            told_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0  # of the frame just read
            if index == 0:
                first_s = told_s
            else:
                stamp_s = self._stamp_s(index, told_s - first_s, stamp_s)
            yield Frame(stamp_s, np.asarray(image, np.uint8), self._name)
            index += 1
        self._capture.release()

    def _stamp_s(self, index: int, told_s: float, last_s: float) -> float:
        """When a frame stands, by what the file tells and when the last one stood."""
        if self._stands_evenly:
            return index / self.fps
        if self.even_from is None:
            if last_s < told_s < last_s + LONGEST_PAUSE_S:
                return told_s
            self.even_from = index
        return last_s + 1.0 / self.fps

    def close(self) -> None:
        """End the iteration."""
        self._closed = True


class LiveFrames:
    """The newest picture of a source that does not wait."""

    live = True

    def __init__(self, open_pictures: Callable[[], Iterator[Callable[[], Image]]]) -> None:
        """Open it once, so that a source that is not there is told at the start.

        Args:
            open_pictures: opens the source; each item decodes one picture.

        Raises:
            CameraError: it cannot be opened.
        """
        self._open_pictures = open_pictures
        self._arrived = threading.Condition()
        self._newest: tuple[float, Callable[[], Image]] | None = None
        self._closed = threading.Event()
        first = open_pictures()
        self._thread = threading.Thread(
            target=self._keep_newest, args=(first,), name="camera-reader", daemon=True
        )
        self._thread.start()

    def __iter__(self) -> Iterator[Frame]:
        while not self._closed.is_set():
            with self._arrived:
                self._arrived.wait_for(self._is_waited_for, timeout=TIMEOUT_S)
                newest, self._newest = self._newest, None
            if newest is not None:
                stamp_s, decode = newest
                yield Frame(stamp_s, decode())

    def close(self) -> None:
        """End the iteration, also from another thread."""
        self._closed.set()
        with self._arrived:
            self._arrived.notify_all()

    def _is_waited_for(self) -> bool:
        return self._newest is not None or self._closed.is_set()

    def _keep_newest(self, pictures: Iterator[Callable[[], Image]]) -> None:
        pause_s, longest_s = RECONNECT_S
        while not self._closed.is_set():
            try:
                for picture in pictures:
                    if self._closed.is_set():
                        return
                    pause_s = RECONNECT_S[0]
                    with self._arrived:
                        self._newest = (time.monotonic(), picture)
                        self._arrived.notify_all()
            except (OSError, http.client.HTTPException):
                pass  # gone; whoever watches the camera sees its silence
            self._closed.wait(pause_s)
            pause_s = min(2 * pause_s, longest_s)
            try:
                pictures = self._open_pictures()
            except CameraError:
                pictures = iter(())


FrameSource = Pictures | Clip | LiveFrames
"""Iterable over `Frame` in order of time, until its end or `close`. Where `live`, stamps are
`time.monotonic()`; otherwise they count from 0."""


def _mjpeg_pictures(url: str) -> Iterator[Callable[[], Image]]:
    # A camera is a neighbour: no proxy of the environment's stands between.
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    try:
        response = opener.open(url, timeout=TIMEOUT_S)
    except (OSError, http.client.HTTPException, ValueError) as error:
        reason = error.reason if isinstance(error, urllib.error.URLError) else error
        raise CameraError(f"camera.source: {url}: {reason}") from error
    header: Message = response.headers
    boundary = header.get_param("boundary")
    if header.get_content_maintype() != "multipart" or not isinstance(boundary, str):
        response.close()
        raise CameraError(f"camera.source: {url}: no MJPEG but {header.get_content_type()}")
    return _parts(response, MjpegParts(boundary.encode("latin-1")))


def _parts(response: http.client.HTTPResponse, parts: MjpegParts) -> Iterator[Callable[[], Image]]:
    with response:
        while data := response.read1(65536):
            parts.receive_bytes(data)
            while (body := parts.next_body()) is not None:
                yield partial(decode_picture, body)


def _device_pictures(settings: CameraSettings) -> Iterator[Callable[[], Image]]:
    source = settings.source
    capture = cv2.VideoCapture(int(source) if source.isdigit() else source)
    if not capture.isOpened():
        raise CameraError(f"camera.source: {source}: no camera there, or it is in use")
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, settings.width_px)
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, settings.height_px)
    if settings.fps is not None:
        capture.set(cv2.CAP_PROP_FPS, settings.fps)
    return _grabbed(capture)


def _grabbed(capture: cv2.VideoCapture) -> Iterator[Callable[[], Image]]:
    while True:
        read, image = capture.read()
        if not read:
            break
        yield partial(np.asarray, image, np.uint8)
    capture.release()


def _picture_files(source: str) -> list[tuple[str, Path]]:
    """(name, path) of the pictures in a folder or fitting a glob, 2 before 10; else none."""
    path = Path(source)
    if path.is_file():
        return [(path.name, path)] if path.suffix.lower() in PICTURES else []
    if path.is_dir():
        base, pattern = path, "**/*"
    else:
        fixed = list(takewhile(lambda part: not set(part) & set("*?["), path.parts))
        if len(fixed) == len(path.parts):
            return []
        base, pattern = Path(*fixed), str(Path(*path.parts[len(fixed) :]))
    files = [file for file in base.glob(pattern) if file.suffix.lower() in PICTURES]
    named = [(file.relative_to(base).as_posix(), file) for file in files if file.is_file()]
    return sorted(named, key=lambda item: _natural(item[0]))


def _why_nothing(source: str) -> str:
    """Why neither a picture nor a video is there."""
    allowed = f"a picture's name ends in {', '.join(sorted(PICTURES))}"
    if Path(source).is_dir():
        return f"no picture in this folder; {allowed}"
    if set(source) & set("*?["):
        return f"no picture fits; {allowed}"
    return "no such file or folder"


def _natural(name: str) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]


class CameraThread:
    """Sees with one camera, beside the loop: OpenCV lets go of the interpreter while it works."""

    def __init__(
        self,
        camera: CameraSettings,
        vision: VisionSettings,
        on_observations: Callable[[list[Event]], None],
        on_picture: Callable[[Image, float], None] | None = None,
    ) -> None:
        """Both are called from the camera's thread.

        Args:
            camera: which one, and how it looks.
            vision: what to look for.
            on_observations: gets what each frame gave.
            on_picture: gets each picture and its stamp.
        """
        self._camera = camera
        self._sight = Sight(camera, vision)
        self._on_observations = on_observations
        self._on_picture = on_picture
        self._closed = threading.Event()

    def start(self) -> None:
        """Open the camera and go.

        Raises:
            CameraError: it cannot be opened.
        """
        self._source = open_frames(self._camera)
        self._thread = threading.Thread(target=self._see, name="camera", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop, and wait until the last frame is through."""
        self._closed.set()
        self._source.close()
        self._thread.join(TIMEOUT_S)

    def _see(self) -> None:
        # A Linux thread has a priority of its own: a warning goes before a picture.
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
        cv2.setNumThreads(1)  # the other cores are not the camera's
        started_at = 0.0 if self._source.live else time.monotonic()
        for frame in self._source:
            stamp_s = started_at + frame.stamp_s
            if not self._source.live and self._closed.wait(stamp_s - time.monotonic()):
                return
            self._sight.receive_frame(frame.image, stamp_s)
            self._hand_over()
            if self._on_picture is not None:
                self._on_picture(frame.image, stamp_s)
        if not self._closed.is_set():
            lost = SensorLost(time.monotonic(), Sensor.CAMERA, None, "end_of_recording")
            self._on_observations([lost])

    def _hand_over(self) -> None:
        observations: list[Event] = []
        while (event := self._sight.next_event()) is not None:
            observations.append(event)
        self._on_observations(observations)
