"""Which observations of the host vehicle's sensors are used, and which of its sensors are lost."""

from collections.abc import Mapping

from onboard.observations import (
    DetectionList,
    Lead,
    Plate,
    Position,
    Sensor,
    SensorLost,
    SensorRecovered,
    Speed,
    VehicleDetection,
)
from onboard.sensors.frozen_speed import FrozenSpeed
from onboard.sensors.sensor_timeout import SensorTimeouts
from onboard.step import Observation


class HostSensors(SensorTimeouts):
    """Takes each observation before the other cores do."""

    def __init__(self, timeouts_s: Mapping[Sensor, float], now: float) -> None:
        """Start with all sensors at work; arguments as of `SensorTimeouts`."""
        super().__init__(timeouts_s, now)
        self._frozen_speed = FrozenSpeed()
        self._has_detector = Sensor.DETECTOR in timeouts_s

    def receive_observation(self, observation: Observation, now: float) -> bool:
        """Restart the timeout of the observation's sensor.

        Returns:
            whether the observation is used.
        """
        match observation:
            case Speed() if self._frozen_speed.receive_speed(observation):
                self.receive_loss(Sensor.SPEED, "frozen", now)
                return False
            case Speed():
                self.receive_sample(Sensor.SPEED, observation.stamp_s, now)
            case Lead():
                self.receive_sample(Sensor.CAMERA, observation.stamp_s, now)
            case Position():
                self.receive_sample(Sensor.POSITION, observation.stamp_s, now)
                self._frozen_speed.receive_position(observation)
            case DetectionList():
                self.receive_sample(Sensor.DETECTOR, observation.stamp_s, now)
            case VehicleDetection():
                return not self._has_detector  # it reports the same vehicle under another track ID
            case Plate(text=None):
                return False  # may be anything that looks like a plate
            case SensorLost():
                self.receive_loss(observation.sensor, observation.reason, now)
                return False
            case SensorRecovered():
                self.receive_sample(observation.sensor, observation.stamp_s, now)
                return False
        return True
