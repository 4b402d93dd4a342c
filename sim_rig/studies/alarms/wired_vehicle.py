"""The `Vehicle` of one car, from its wires on: NMEA, a detector's JSON, speeds in whole km/h."""

import math
from collections.abc import Callable, Collection, Iterator, Mapping

import numpy as np

from onboard.detector.object_list import ObjectListReader
from onboard.gnss.nmea import NmeaReader
from onboard.gnss.settings import GnssSettings
from onboard.kinematics.units import KM_H
from onboard.mvs.settings import MvsSettings, SensingSettings
from onboard.observations import Sensor, Speed, YawRate
from onboard.risk.alarm import Alarm, Level
from onboard.risk.settings import RiskSettings
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import Pseudonym
from onboard.security.settings import PlateDigestSettings
from onboard.step import Observation
from onboard.vehicle.config import CarConfig, CarSettings
from onboard.vehicle.vehicle import Vehicle
from sim_rig.cars.gnss_receiver import GnssReceiver
from sim_rig.cars.vehicle_camera import VehicleCamera
from sim_rig.cars.vehicle_detector import ExternalDetector
from sim_rig.roads.recording import STEP_S
from sim_rig.roads.road import CarState
from sim_rig.roads.trajectory_drive import TrajectoryDrive
from sim_rig.scenario.sensor_settings import ReceiverSettings, VehicleCameraSettings

START_UTC_S = 1_750_000_000.0
EVERY_S = 0.1
"""Period of the assessment, and of the samples of the speed."""
SPEED_AGE_S = 0.05
"""Of a sample of the speed, and of the yaw rate."""
YAW_RATE_EVERY_S, YAW_RATE_SIGMA_RAD_S = 0.02, 0.005
"""Period of the yaw rate on the bus, and its noise."""
LENGTH_M, WIDTH_M, HEIGHT_M = 4.5, 1.8, 1.5

CarsAt = Callable[[float], Mapping[str, CarState]]


class WiredVehicle:
    """A car with a receiver, a bus, and a detector or none."""

    def __init__(
        self,
        name: str,
        drives: Mapping[str, TrajectoryDrive],
        detector: VehicleCameraSettings | None,
        rng: np.random.Generator,
        *,
        receivers: ReceiverSettings,
        risk: RiskSettings,
        beacons: bool = False,
        has_yaw_rate: bool = False,
        sky_seed: int | None = None,
    ) -> None:
        """Start all wires at phases of their own.

        Args:
            name: of the car among `drives`.
            drives: motion of all cars.
            detector: its errors; `None` for a car without one.
            rng: source of all draws.
            receivers: errors of the receiver.
            risk: thresholds of the alarms.
            beacons: whether it sends BSMs.
            has_yaw_rate: whether its bus has a yaw rate, which has been found right before.
            sky_seed: source of the errors that receivers share; of its own if `None`.
        """
        self.drive = drives[name]
        own_rng, sky_rng, camera_rng, self.rng = rng.spawn(4)
        if sky_seed is not None:
            sky_rng = np.random.default_rng(sky_seed)
        phases_s = rng.uniform(0.0, EVERY_S, 3)
        self._receiver = GnssReceiver(receivers, self.drive.state, START_UTC_S, own_rng, sky_rng)
        self._detector: ExternalDetector | None = None
        if detector is not None:
            camera = VehicleCamera(detector, name, _cars_at(drives), camera_rng)
            self._detector = ExternalDetector(camera, phase_s=float(phases_s[0]))
        self._nmea = NmeaReader(GnssSettings(latency_s=receivers.latency_s))
        self._objects = ObjectListReader()
        self._speed_at, self.assesses_at = float(phases_s[1]), float(phases_s[2])
        self._yaw_rate_at = self._speed_at if has_yaw_rate else math.inf
        sensors = {Sensor.POSITION, *([] if detector is None else [Sensor.DETECTOR])}
        self.vehicle = vehicle(name, risk, sensors, self.assesses_at, self.rng, beacons=beacons)

    def get_timer(self) -> float:
        """Return when a wire or the vehicle is next due."""
        wires = [
            self._receiver.get_timer(),
            self._speed_at,
            self._yaw_rate_at,
            self.vehicle.get_timer(),
        ]
        return min(*wires, math.inf if self._detector is None else self._detector.get_timer())

    def read_wires(self, now: float) -> Speed | None:
        """Hand on what has arrived; returns the exact speed, if one was sampled."""
        if data := self._receiver.bytes_to_send(now):
            self._nmea.receive_bytes(data, now)
        if self._detector is not None and (data := self._detector.bytes_to_send(now)):
            self._objects.receive_bytes(data, now)
        for event in (*iter(self._nmea.next_event, None), *iter(self._objects.next_event, None)):
            if isinstance(event, Observation):
                self.vehicle.receive_observation(event, now)
        self._read_yaw_rate(now)
        return self._read_speed(now)

    def _read_yaw_rate(self, now: float) -> None:
        if now < self._yaw_rate_at:
            return
        self._yaw_rate_at += YAW_RATE_EVERY_S
        at_s = now - SPEED_AGE_S
        before, after = (self.drive.state(at_s + side * STEP_S / 2.0) for side in (-1.0, 1.0))
        turned_rad = math.remainder(after.heading_rad - before.heading_rad, math.tau)
        noise_rad_s = YAW_RATE_SIGMA_RAD_S * self.rng.standard_normal()
        yaw_rate_rad_s = turned_rad / STEP_S + noise_rad_s
        self.vehicle.take_checked(YawRate(at_s, yaw_rate_rad_s, "can"), now)

    def _read_speed(self, now: float) -> Speed | None:
        if now < self._speed_at:
            return None
        self._speed_at += EVERY_S
        at_s = now - SPEED_AGE_S
        speed_m_s = self.drive.state(at_s).speed_m_s
        whole_m_s = math.floor(speed_m_s / KM_H) * KM_H
        self.vehicle.receive_observation(Speed(at_s, whole_m_s, KM_H, "obd:7E8"), now)
        return Speed(at_s, speed_m_s, KM_H, "obd:7E8")


def _cars_at(drives: Mapping[str, TrajectoryDrive]) -> CarsAt:
    return lambda at_s: {name: drive.state(at_s) for name, drive in drives.items()}


def vehicle(
    name: str,
    risk: RiskSettings,
    sensors: Collection[Sensor],
    now: float,
    rng: np.random.Generator,
    *,
    beacons: bool = False,
) -> Vehicle:
    """Return a vehicle that is first assessed at `now`; its radio sends BSMs or nothing."""
    config = CarConfig(
        car=CarSettings(plate=name.upper(), length_m=LENGTH_M, width_m=WIDTH_M),
        mvs=MvsSettings(sensing=SensingSettings(camera_ahead_m=LENGTH_M / 2.0)),
        risk=risk,
        beacons=beacons,
    )
    return Vehicle(
        config,
        {Sensor.SPEED, *sensors},
        rng,
        now=now,
        utc_offset_s=START_UTC_S,
        pseudonym=Pseudonym(bytes(8), name.encode().ljust(4)[:4], 0, None, math.inf),
        digest=PlateDigest(PlateDigestSettings(scrypt_log2_n=1)),  # no plate is read
    )


def warnings(of: Vehicle, now: float) -> Iterator[Alarm]:
    """Handle a vehicle's timer if it is due, and yield the alarms that became warnings."""
    if of.get_timer() <= now:
        of.handle_timer(now)
    for event in iter(of.next_event, None):
        if isinstance(event, Alarm) and event.level is Level.WARNING:
            yield event
