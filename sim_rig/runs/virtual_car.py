"""One car in virtual time: its stack, connected to the simulated devices."""

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from onboard.brake_request import datagram
from onboard.brake_request.brake_requester import BrakeRequest
from onboard.detector.object_list import ObjectListReader
from onboard.gnss.nmea import NmeaReader
from onboard.gnss.settings import GnssSettings
from onboard.lcca.epoch_ids import ADJACENT_S
from onboard.obd.can_frame import CanFrame
from onboard.obd.dbc_file import read_signals
from onboard.observations import Lead, Sensor
from onboard.replay.initial_state import InitialState
from onboard.replay.recorded_stack import recorded_stack
from onboard.security.credentials import Credentials
from onboard.settings import parse_settings
from onboard.step import Input, Observation, ReceivedWsm, SentWsm
from onboard.trace.trace_line import as_trace_record
from onboard.vehicle.config import CarConfig
from sim_rig.cars.brake_controller import BrakeController
from sim_rig.cars.camera_model import CameraModel
from sim_rig.cars.camera_view import CameraView, calibration
from sim_rig.cars.derivation_delay import DerivationDelay
from sim_rig.cars.device_line import Device
from sim_rig.cars.faulty_ecu import FaultyEcu
from sim_rig.cars.gnss_receiver import GnssReceiver
from sim_rig.cars.vehicle_camera import VehicleCamera
from sim_rig.cars.vehicle_detector import ExternalDetector
from sim_rig.cars.vehicle_faults import VehicleFaults
from sim_rig.roads.road import CarState, Road, yaw_rate_rad_s
from sim_rig.run_log.run_log import Record
from sim_rig.runs.virtual_recorder import VirtualRecorder
from sim_rig.scenario.car_config import car_config, gnss_config
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.sensor_settings import ReceiverSettings

START_UTC_S = 1_750_000_000.0
"""UTC at the start of every run in virtual time: in June 2025."""

_Reader = NmeaReader | ObjectListReader


class VirtualCar:
    """Passes the output of the simulated devices to the stack, and returns its frames."""

    def __init__(
        self,
        scenario: Scenario,
        road: Road,
        name: str,
        seed: np.random.SeedSequence,
        sky_seed: np.random.SeedSequence,
        *,
        recorder: VirtualRecorder | None,
        credentials: Credentials | None,
        on_ecu_frame: Callable[[CanFrame], None],
        controller: BrakeController | None = None,
        start_utc_s: float = START_UTC_S,
    ) -> None:
        """Start the devices and the stack of the car at time 0.

        Args:
            scenario: the scenario.
            road: the road with all cars.
            name: name of this car.
            seed: source of the random numbers of this car.
            sky_seed: source of those that the GNSS receivers of all cars share.
            recorder: recorder of the drive, if the car has one.
            credentials: certificates and keys, if messages are signed.
            on_ecu_frame: takes each CAN frame of the ECU.
            controller: obeys requests to brake; `None` if the car does not.
            start_utc_s: UTC at time 0, s.
        """
        self.name = name
        self.trace: list[Record] = []
        self.planned_at = math.inf
        self._start_utc_s = start_utc_s
        self._seed, *other_seeds = seed.spawn(5)
        camera_rng, gnss_rng, vehicles_rng, ecu_rng = map(np.random.default_rng, other_seeds)
        self._config = parse_settings(car_config(scenario, name, seed=0), CarConfig, name)
        self._sensors = _sensors(scenario)
        self._credentials = credentials
        self._recorder = recorder
        self._faults = VehicleFaults(scenario, name)
        self._on_ecu_frame = on_ecu_frame
        self._controller = controller
        self._waiting: list[bytes] = []
        self._rate_hz = scenario.lens.rate_hz
        self._phase_s = scenario.equipped.index(name) / self._rate_hz / len(scenario.equipped)
        self._view = CameraView(scenario, road, name, camera_rng)
        self._camera_rng = camera_rng
        self._lens = calibration(scenario.lens)
        self._ecu = FaultyEcu(
            scenario,
            name,
            speed_m_s=lambda now: road.car_at(name, now).speed_m_s,
            at_s=lambda now: now,
            rng=ecu_rng,
            yaw_rate_rad_s=partial(yaw_rate_rad_s, road, name),
        )
        self._devices: list[tuple[Device, _Reader]] = []
        if scenario.gnss is not None:
            sky_rng = np.random.default_rng(sky_seed)
            self._devices.append(self._receiver(road, scenario.gnss, gnss_rng, sky_rng))
        if scenario.detector is not None:
            vehicles = VehicleCamera(scenario.detector, name, road.cars_at, vehicles_rng)
            self._devices.append((ExternalDetector(vehicles, self._phase_s), ObjectListReader()))
        self._start(0.0)

    def get_timer(self) -> float:
        """Return when a device or the stack of this car is next due."""
        at = min(
            self._stack_at,
            self._camera.get_timer(),
            self._ecu.get_timer(),
            *(device.get_timer() for device, _ in self._devices),
        )
        return self._faults.wakes_at(at)

    def is_asleep(self, now: float) -> bool:
        """Whether the daemon does not have the processor."""
        return self._faults.wakes_at(now) > now

    def receive_wsm(self, wsm: bytes, now: float) -> list[SentWsm]:
        """Receive a frame from the radio unit; return the frames for it."""
        if self._faults.is_off(now):
            return []
        self._start_if_due(now)
        self._waiting.append(wsm)
        return [] if self.is_asleep(now) else self.step(now)

    def handle_timer(self, now: float) -> list[SentWsm]:
        """Read all wires and step the cores; return the frames for the radio unit."""
        self._start_if_due(now)
        frames = self._ecu.frames_to_send(now)
        for frame in frames:
            self._on_ecu_frame(frame)
        self._camera.receive_curvature(self._stack.curvature(now))
        self._camera.handle_timer(now)
        seen: list[Observation] = list(iter(self._camera.next_event, None))
        observations = [
            self._derivation.derived(each, now, self._ids_of_a_text(now))
            if isinstance(each, Lead)
            else each
            for each in seen
        ]
        for device, reader in self._devices:
            if data := device.bytes_to_send(now):
                reader.receive_bytes(data, now)
                observations += iter(reader.next_event, None)
        return self.step(now, (*frames, *observations))

    def step(self, now: float, inputs: Sequence[Input] = ()) -> list[SentWsm]:
        """Step the cores with the waiting frames and `inputs`; return the frames for the radio."""
        utc_s = None
        if self._faults.has_wrong_clock:
            utc_s = self._start_utc_s + now + self._faults.clock_error_s(now)
        waiting = [ReceivedWsm(now, wsm) for wsm in self._waiting]
        self._waiting.clear()
        outputs = self._stack.step((*waiting, *inputs), now, utc_s)
        self._stack_at = outputs.timer_at
        for frame in outputs.can_frames:
            self._ecu.receive_frame(frame, now)
        for event in outputs.events:
            if self._controller is not None and isinstance(event, BrakeRequest):
                self._controller.receive_bytes(datagram.encode(event), now)
        self.trace += map(as_trace_record, outputs.events)
        return outputs.wsms

    def _ids_of_a_text(self, now: float) -> int:
        """2 while the IDs of the epoch before are in use."""
        utc_s = self._start_utc_s + now + self._faults.clock_error_s(now)
        epochs = (self._stack.digest.epoch(each_s) for each_s in (utc_s, utc_s - ADJACENT_S))
        return len(set(epochs))

    def _start_if_due(self, now: float) -> None:
        """Start the daemon anew if the power is back."""
        since_s = self._faults.on_since(now)
        if since_s > self._on_since_s:
            for device, _ in self._devices:
                device.skip_to(now)
            self._ecu.frames_to_send(now)
            self._seed = self._seed.spawn(1)[0]
            self._start(since_s)

    def _start(self, now: float) -> None:
        """Start the daemon, which knows nothing of an earlier start."""
        self._on_since_s = now
        self._waiting.clear()
        self._stack = recorded_stack(
            self._recorder,
            InitialState(
                config=self._config,
                sensors=self._sensors,
                seed=self._seed,
                now=now,
                utc_s=self._start_utc_s + now + self._faults.clock_error_s(now),
                credentials=self._credentials,
                signals=read_signals(self._config.obd.broadcast),
            ),
        )
        self._stack_at = self._stack.get_timer()
        images = math.ceil((now - self._phase_s) * self._rate_hz)
        self._camera = CameraModel(
            self._view,
            self._config.vision,
            self._phase_s + images / self._rate_hz,
            self._camera_rng,
            self._lens,
            rate_hz=self._rate_hz,
        )
        self._derivation = DerivationDelay()

    def _receiver(
        self,
        road: Road,
        settings: ReceiverSettings,
        rng: np.random.Generator,
        sky_rng: np.random.Generator,
    ) -> tuple[Device, _Reader]:
        def state_at(now: float) -> CarState | None:
            return self._faults.received(road.car_at(self.name, now), now)

        receiver = GnssReceiver(settings, state_at, self._start_utc_s, rng, sky_rng)
        return receiver, NmeaReader(GnssSettings.model_validate(gnss_config(settings)))


def _sensors(scenario: Scenario) -> frozenset[Sensor]:
    """Sensors of every equipped car."""
    given = {Sensor.POSITION: scenario.gnss, Sensor.DETECTOR: scenario.detector}
    extra = (sensor for sensor, settings in given.items() if settings is not None)
    return frozenset({Sensor.SPEED, Sensor.CAMERA, Sensor.RADIO, *extra})
