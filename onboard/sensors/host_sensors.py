"""Which observations of the host vehicle's sensors are used, and which of its sensors are lost."""

from collections.abc import Mapping

from onboard.observations import (
    DetectionList,
    Discarded,
    Lead,
    Plate,
    Position,
    Sensor,
    SensorLost,
    SensorRecovered,
    Speed,
    Steering,
    VehicleDetection,
    YawRate,
)
from onboard.sensors.frozen_speed import FrozenSpeed
from onboard.sensors.sensor_timeout import SensorTimeouts
from onboard.sensors.turn_check import TurnCheck
from onboard.step import HostObservation


class HostSensors(SensorTimeouts):
    """Takes each observation before the other cores do."""

    def __init__(self, timeouts_s: Mapping[Sensor, float], now: float) -> None:
        """Start with all sensors at work; arguments as of `SensorTimeouts`."""
        super().__init__(timeouts_s, now)
        self._frozen_speed = FrozenSpeed()
        self._turn_check = TurnCheck()
        self._contradicted: set[str] = set()
        self._has_detector = Sensor.DETECTOR in timeouts_s

    def receive_observation(self, observation: HostObservation, now: float) -> bool:
        """Restart the timeout of the observation's sensor.

        Returns:
            whether the observation is used.
        """
        if isinstance(observation, Speed | YawRate | Steering | Position):
            self._turn_check.receive_observation(observation)
        match observation:
            case YawRate() | Steering():
                return self._agrees(observation)
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
            case SensorLost() | SensorRecovered():
                self._receive_report(observation, now)
                return False
        return True

    def _receive_report(self, report: SensorLost | SensorRecovered, now: float) -> None:
        if isinstance(report, SensorLost):
            self.receive_loss(report.sensor, report.reason, now)
        else:
            self.receive_sample(report.sensor, report.stamp_s, now)

    def _agrees(self, turn: YawRate | Steering) -> bool:
        """Whether it turns as the vehicle does; reported once for each time that it does not."""
        if not self._turn_check.is_contradicted(turn):
            self._contradicted.discard(turn.kind)
            return self._turn_check.is_used(turn)
        if turn.kind not in self._contradicted:
            self._contradicted.add(turn.kind)
            self._events.append(
                Discarded(turn.stamp_s, "obd", "contradicted", f"{turn.kind} by {turn.source}")
            )
        return False
