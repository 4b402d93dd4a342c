"""Plays a recording in place of a camera, in a thread of the daemon.

At a desk no warning has to be in time, and the daemon stays one process.
"""

import threading
import time
from collections.abc import Callable

import cv2

from onboard.observations import Curvature, Sensor, SensorLost
from onboard.thread_priority import lower_thread_priority
from onboard.vision.camera import open_recorded
from onboard.vision.camera_process import CameraWork
from onboard.vision.frame_observer import FrameObserver
from onboard.vision.live_frames import TIMEOUT_S
from onboard.vision.networks import load_perception
from onboard.vision.seen import Seen
from onboard.vision.settings import CameraSettings

NICENESS = 10
"""Niceness of the thread."""


def recorded_camera(work: CameraWork, on_seen: Callable[[Seen], None]) -> "RecordedCamera":
    """Make a camera of a recording, with the networks of its settings.

    Raises:
        UserError: the recording or a model cannot be opened.
    """
    observer = FrameObserver(load_perception(work.camera, work.vision), work.pictures)
    return RecordedCamera(work.camera, observer, on_seen)


class RecordedCamera:
    """Runs perception in a thread beside the loop: OpenCV releases the interpreter's lock."""

    def __init__(
        self, camera: CameraSettings, observer: FrameObserver, on_seen: Callable[[Seen], None]
    ) -> None:
        """Open the recording; `on_seen` is called from the thread for each frame.

        Raises:
            CameraError: it cannot be opened.
        """
        self._source = open_recorded(camera)
        self._observer = observer
        self._on_seen = on_seen
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)

    def receive_curvature(self, curvature: Curvature | None) -> None:
        """Take the curvature of the vehicle's path, for the next frame; called from the loop."""
        self._observer.receive_curvature(curvature)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """Stop, and wait until the last frame is processed."""
        self._closed.set()
        self._source.close()
        if self._thread.ident is not None:
            self._thread.join(TIMEOUT_S)

    def _run(self) -> None:
        # A Linux thread has a priority of its own: warnings take precedence over frames.
        lower_thread_priority(NICENESS)
        cv2.setNumThreads(1)  # leaves the other cores to the rest
        started_at = time.monotonic()
        for frame in self._source:
            stamp_s = started_at + frame.stamp_s
            if self._closed.wait(stamp_s - time.monotonic()):
                return
            self._on_seen(self._observer.receive_frame(frame.image, stamp_s))
        if not self._closed.is_set():
            lost = SensorLost(time.monotonic(), Sensor.CAMERA, None, "end_of_recording")
            self._on_seen(Seen((lost,)))
