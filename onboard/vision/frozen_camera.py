"""Whether the camera delivers new images, or repeats one: then it is lost, until one is new."""

import math

from onboard.observations import Sensor, SensorLost, SensorRecovered


class FrozenCamera:
    """Watches which frames are repeats."""

    def __init__(self, after_s: float) -> None:
        """Take the time for which repeats of one image are no loss."""
        self._after_s = after_s
        self._changed_at = -math.inf
        """Stamp of the last frame that was no repeat."""
        self._is_frozen = False

    def silent_s(self, stamp_s: float) -> float:
        """Time since the last new image; infinite before the first."""
        return stamp_s - self._changed_at

    def is_lost(self, stamp_s: float) -> bool:
        """Whether the repeats last too long."""
        return self.silent_s(stamp_s) > self._after_s

    def receive_repeat(self, stamp_s: float) -> list[SensorLost]:
        """Report the loss of the camera, once."""
        if self._is_frozen or not self.is_lost(stamp_s):
            return []
        self._is_frozen = True
        return [SensorLost(stamp_s, Sensor.CAMERA, self.silent_s(stamp_s), "frozen")]

    def receive_new_image(self, stamp_s: float) -> list[SensorRecovered]:
        """Report that the camera is back, if it was lost."""
        was_frozen, self._is_frozen, self._changed_at = self._is_frozen, False, stamp_s
        return [SensorRecovered(stamp_s, Sensor.CAMERA)] if was_frozen else []
