"""Frames of a live camera: a device, or MJPEG over HTTP.

A thread reads them and keeps the newest one only, so that a slow consumer gets current frames; it
reopens a lost source.
"""

import http.client
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from email.message import Message
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from onboard.vision.frames import CameraError, Frame, Image, decode_jpeg
from onboard.vision.mjpeg import MjpegParts
from onboard.vision.settings import CameraSettings

TIMEOUT_S = 2.0
"""Silence after which a source is reopened."""
RECONNECT_S = (0.1, 2.0)
"""Pause before the first attempt to reopen, and the longest before later ones."""


class LiveFrames:
    """The newest frame of a live source."""

    live = True

    def __init__(self, open_stream: Callable[[], Iterator[Callable[[], Image]]]) -> None:
        """Open the source; one that is missing is an error now.

        Args:
            open_stream: opens the source; each item decodes one image.

        Raises:
            CameraError: it cannot be opened.
        """
        self._open_stream = open_stream
        self._arrived = threading.Condition()
        self._newest: tuple[float, Callable[[], Image]] | None = None
        self._closed = threading.Event()
        first = open_stream()
        self._thread = threading.Thread(
            target=self._keep_newest, args=(first,), name="camera-reader", daemon=True
        )
        self._thread.start()

    def __iter__(self) -> Iterator[Frame]:
        while not self._closed.is_set():
            frame = self.next_frame()
            if frame is not None:
                yield frame

    def next_frame(self) -> Frame | None:
        """Wait for a frame and return it; `None` if none comes within `TIMEOUT_S`."""
        with self._arrived:
            self._arrived.wait_for(self._has_news, timeout=TIMEOUT_S)
            newest, self._newest = self._newest, None
        if newest is None:
            return None
        stamp_s, decode = newest
        return Frame(stamp_s, decode())

    def close(self) -> None:
        """End the iteration, also from another thread."""
        self._closed.set()
        with self._arrived:
            self._arrived.notify_all()

    def _has_news(self) -> bool:
        return self._newest is not None or self._closed.is_set()

    def _keep_newest(self, images: Iterator[Callable[[], Image]]) -> None:
        pause_s, longest_s = RECONNECT_S
        while not self._closed.is_set():
            try:
                for image in images:
                    if self._closed.is_set():
                        return
                    pause_s = RECONNECT_S[0]
                    with self._arrived:
                        self._newest = (time.monotonic(), image)
                        self._arrived.notify_all()
            except (OSError, http.client.HTTPException):
                pass  # lost; the sensor timeout reports it
            self._closed.wait(pause_s)
            pause_s = min(2 * pause_s, longest_s)
            try:
                images = self._open_stream()
            except CameraError:
                images = iter(())


def mjpeg_frames(url: str) -> LiveFrames:
    """Frames of a network camera.

    Raises:
        CameraError: there is no answer, or it is not MJPEG.
    """
    return LiveFrames(lambda: _mjpeg_images(url))


def device_frames(settings: CameraSettings) -> LiveFrames:
    """Frames of a camera at this computer.

    Raises:
        CameraError: it is missing, or in use.
    """
    return LiveFrames(lambda: _device_images(settings))


def _mjpeg_images(url: str) -> Iterator[Callable[[], Image]]:
    # A camera is in the local network: proxies of the environment are not used.
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
        raise CameraError(f"camera.source: {url}: expected MJPEG, got {header.get_content_type()}")
    return _parts(response, MjpegParts(boundary.encode("latin-1")))


def _parts(response: http.client.HTTPResponse, parts: MjpegParts) -> Iterator[Callable[[], Image]]:
    with response:
        while data := response.read1(65536):
            parts.receive_bytes(data)
            while (body := parts.next_body()) is not None:
                yield partial(decode_jpeg, body)


def _device_images(settings: CameraSettings) -> Iterator[Callable[[], Image]]:
    source = settings.source
    if not Path(f"/dev/video{source}" if source.isdigit() else source).exists():
        raise CameraError(f"camera.source: {source}: no such camera")  # OpenCV says it at length
    capture = cv2.VideoCapture(int(source) if source.isdigit() else source)
    if not capture.isOpened():
        raise CameraError(f"camera.source: {source}: no camera, or it is in use")
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
