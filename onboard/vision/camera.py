"""The camera: opens what the settings name, and sees with it."""

import os
import threading
import time
from collections.abc import Callable

import cv2

from onboard.observations import Sensor, SensorLost
from onboard.vision.frames import CameraError, Image
from onboard.vision.live_frames import TIMEOUT_S, LiveFrames, device_frames, mjpeg_frames
from onboard.vision.perception import Event, Perception
from onboard.vision.recordings import Clip, Pictures, open_recording
from onboard.vision.settings import CameraSettings, VisionSettings

NICENESS = 10
"""Of the thread that sees."""

FrameSource = Pictures | Clip | LiveFrames
"""Iterable over `Frame` in order of time, until its end or `close`. Where `live`, stamps are
`time.monotonic()`; otherwise they count from 0."""


def open_frames(settings: CameraSettings) -> FrameSource:
    """Open the source that the settings name.

    Raises:
        CameraError: it is not there, or is not what it should be.
    """
    source = settings.source
    if source.startswith(("http://", "https://")):
        return mjpeg_frames(source)
    if "://" in source:
        raise CameraError(
            f"camera.source: {source}: of streams, only MJPEG by http:// or https:// is read"
        )
    if source.isdigit() or source.startswith("/dev/"):
        return device_frames(settings)
    return open_recording(source, settings.fps)


def open_recorded(settings: CameraSettings) -> Pictures | Clip:
    """Open a source that ends.

    Raises:
        CameraError: it cannot be opened, or is live.
    """
    frames = open_frames(settings)
    if isinstance(frames, LiveFrames):
        raise CameraError(f"{settings.source}: a live camera has no end; record it first")
    return frames


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
        self._sight = Perception(camera, vision)
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
