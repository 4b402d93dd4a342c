"""A vehicle detector beside the car's own vision: what it sends of each picture, as JSON."""

import json

from sim_rig.cars.vehicle_camera import FPS, VehicleCamera

LATENCY_S = 0.04
"""From the moment that the picture shows until its cars are sent."""


class VehicleDetector:
    """One car's, without I/O."""

    def __init__(self, camera: VehicleCamera, phase_s: float) -> None:
        """Take the first picture at `phase_s`."""
        self._camera = camera
        self._picture_at = phase_s

    def skip_to(self, now: float) -> None:
        """Take no picture before `now`."""
        self._picture_at = max(self._picture_at, now)

    def get_timer(self) -> float:
        """When the next picture has been looked through."""
        return self._picture_at + LATENCY_S

    def bytes_to_send(self, now: float) -> bytes:
        """A datagram of `onboard.detector`; empty while there is nothing to say."""
        if now < self.get_timer():
            return b""
        at, self._picture_at = self._picture_at, self._picture_at + 1 / FPS
        cars = [
            {
                "id": seen.track_id,
                "range_m": seen.range_m,
                "range_sigma_m": seen.range_sigma_m,
                "bearing_rad": seen.bearing_rad,
                "bearing_sigma_rad": seen.bearing_sigma_rad,
            }
            for seen in self._camera.look(at)
        ]
        return json.dumps({"sent_s": now, "age_s": now - at, "cars": cars}).encode()
