"""The camera's edge: opens the source of frames, and runs perception in a thread."""

import threading
import time
from collections.abc import Callable

import cv2

from onboard.observations import Curvature, Sensor, SensorLost
from onboard.thread_priority import lower_thread_priority
from onboard.vision.frames import CameraError, Image
from onboard.vision.live_frames import TIMEOUT_S, LiveFrames, device_frames, mjpeg_frames
from onboard.vision.perception import Event, Perception
from onboard.vision.recordings import ImageSequence, VideoFile, open_recording
from onboard.vision.settings import CameraSettings

NICENESS = 10
"""Niceness of the camera's thread."""

FrameSource = ImageSequence | VideoFile | LiveFrames
"""Iterable over `Frame` in order of time, until its end or `close`. Where `live`, stamps are
`time.monotonic()`; otherwise they count from 0."""


def open_frames(settings: CameraSettings) -> FrameSource:
    """Open the source that the settings name.

    Raises:
        CameraError: it is missing, or is of no known kind.
    """
    source = settings.source
    if source.startswith(("http://", "https://")):
        return mjpeg_frames(source)
    if "://" in source:
        raise CameraError(
            f"camera.source: {source}: the only streams are MJPEG by http:// or https://"
        )
    if source.isdigit() or source.startswith("/dev/"):
        return device_frames(settings)
    return open_recording(source, settings.fps)


def open_recorded(settings: CameraSettings) -> ImageSequence | VideoFile:
    """Open a recorded source, which has an end.

    Raises:
        CameraError: it cannot be opened, or is live.
    """
    frames = open_frames(settings)
    if isinstance(frames, LiveFrames):
        raise CameraError(f"{settings.source}: a live camera has no end; record it first")
    return frames


class CameraThread:
    """Runs perception in a thread beside the loop: OpenCV releases the interpreter's lock."""

    def __init__(
        self,
        camera: CameraSettings,
        perception: Perception,
        on_observations: Callable[[list[Event]], None],
        on_image: Callable[[Image, float], None] | None = None,
    ) -> None:
        """Take the callbacks; both are called from the camera's thread.

        Args:
            camera: source of the frames.
            perception: gets each frame.
            on_observations: gets the observations of each frame.
            on_image: gets each image and its stamp.
        """
        self._camera = camera
        self._perception = perception
        self._on_observations = on_observations
        self._on_image = on_image
        self._closed = threading.Event()
        self._curvature: Curvature | None = None

    def receive_curvature(self, curvature: Curvature | None) -> None:
        """Take the curvature of the vehicle's path, for the next frame; called from the loop."""
        self._curvature = curvature

    def start(self) -> None:
        """Open the camera and start the thread.

        Raises:
            CameraError: it cannot be opened.
        """
        self._source = open_frames(self._camera)
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop, and wait until the last frame is processed."""
        self._closed.set()
        self._source.close()
        self._thread.join(TIMEOUT_S)

    def _run(self) -> None:
        # A Linux thread has a priority of its own: warnings take precedence over frames.
        lower_thread_priority(NICENESS)
        cv2.setNumThreads(1)  # leaves the other cores to the rest
        started_at = 0.0 if self._source.live else time.monotonic()
        for frame in self._source:
            stamp_s = started_at + frame.stamp_s
            if not self._source.live and self._closed.wait(stamp_s - time.monotonic()):
                return
            self._perception.receive_curvature(self._curvature)
            self._perception.receive_frame(frame.image, stamp_s)
            self._pass_on_observations()
            if self._on_image is not None:
                self._on_image(frame.image, stamp_s)
        if not self._closed.is_set():
            lost = SensorLost(time.monotonic(), Sensor.CAMERA, None, "end_of_recording")
            self._on_observations([lost])

    def _pass_on_observations(self) -> None:
        observations: list[Event] = []
        while (event := self._perception.next_event()) is not None:
            observations.append(event)
        self._on_observations(observations)
