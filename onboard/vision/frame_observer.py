"""Runs perception on frames, and encodes those that are to be recorded."""

import math

import cv2

from onboard.observations import Curvature
from onboard.vision.frames import Image
from onboard.vision.perception import Perception
from onboard.vision.seen import Event, Picture, PictureRate, Seen


class FrameObserver:
    """One frame in, what is seen in it out."""

    def __init__(self, perception: Perception, pictures: PictureRate | None) -> None:
        """Take the perception, and the rate of recorded frames; `None` records none."""
        self._perception = perception
        self._pictures = pictures
        self._next_picture_at = -math.inf
        self._curvature: Curvature | None = None

    def receive_curvature(self, curvature: Curvature | None) -> None:
        """Take the curvature of the vehicle's path, for the next frame; from any thread."""
        self._curvature = curvature

    def receive_duration(self, took_s: float) -> None:
        """Take how long the last frame took."""
        self._perception.receive_duration(took_s)

    def receive_frame(self, image: Image, stamp_s: float) -> Seen:
        """Process one frame; an empty image is one that did not decode."""
        self._perception.receive_curvature(self._curvature)
        self._perception.receive_frame(image, stamp_s)
        events: list[Event] = []
        while (event := self._perception.next_event()) is not None:
            events.append(event)
        return Seen(tuple(events), self._picture(image, stamp_s))

    def _picture(self, image: Image, stamp_s: float) -> Picture | None:
        if self._pictures is None or stamp_s < self._next_picture_at or not image.size:
            return None
        self._next_picture_at = stamp_s + 1.0 / self._pictures.hz
        quality = [cv2.IMWRITE_JPEG_QUALITY, self._pictures.quality]
        return Picture(stamp_s, cv2.imencode(".jpg", image, quality)[1].tobytes())
