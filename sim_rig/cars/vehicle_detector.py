"""An external vehicle detector, which sends its detections of each image as JSON."""

import json
from collections.abc import Iterable

from onboard.observations import VehicleDetection
from sim_rig.cars.vehicle_camera import VehicleCamera

LATENCY_S = 0.04
"""Delay from the time of an image to the datagram with its detections."""


class ExternalDetector:
    """The vehicle detector of one car, without I/O."""

    def __init__(self, camera: VehicleCamera, phase_s: float) -> None:
        """Take the first image at `phase_s`."""
        self._camera = camera
        self._image_at = phase_s

    def skip_to(self, now: float) -> None:
        """Take no image before `now`."""
        self._image_at = max(self._image_at, now)

    def get_timer(self) -> float:
        """Return when the detections of the next image are ready."""
        return self._image_at + LATENCY_S

    def bytes_to_send(self, now: float) -> bytes:
        """Return a datagram in the format of `onboard.detector`; empty if none is due."""
        if now < self.get_timer():
            return b""
        at, self._image_at = self._image_at, self._image_at + self._camera.interval_s
        return datagram(self._camera.detect(at), at, now)


def datagram(detections: Iterable[VehicleDetection], at_s: float, sent_s: float) -> bytes:
    """Return a list of detections in the format of `onboard.detector`.

    Args:
        detections: of one image.
        at_s: time of the image, s.
        sent_s: time of sending on the same clock, s.
    """
    cars = [_as_object(detection) for detection in detections]
    return json.dumps({"sent_s": sent_s, "age_s": sent_s - at_s, "cars": cars}).encode()


def _as_object(detection: VehicleDetection) -> dict[str, float]:
    described: dict[str, float | None] = {
        "id": detection.track_id,
        "range_m": detection.range_m,
        "range_sigma_m": detection.range_sigma_m,
        "bearing_rad": detection.bearing_rad,
        "bearing_sigma_rad": detection.bearing_sigma_rad,
        "range_rate_m_s": detection.range_rate_m_s,
        "range_rate_sigma_m_s": detection.range_rate_sigma_m_s,
    }
    return {name: value for name, value in described.items() if value is not None}
