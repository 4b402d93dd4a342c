"""The same cores in virtual time: faster than real time, and the same to the bit for one seed.

Each car is a `Stack`, the very one that its daemon drives, with the rig's own ECU on its bus, the
rig's air behind its radio, and what its receiver and its detector send read by the car's own
readers. Only the camera is a model (`cars/camera_model.py`): pictures are not drawn, what vision
would have said of them is. Between events no time passes.
"""

import heapq
import math
from collections import deque
from collections.abc import Mapping
from itertools import count
from pathlib import Path

import numpy as np

from onboard.config import CarConfig
from onboard.detector.object_list import ObjectListReader
from onboard.gnss.nmea import NmeaReader
from onboard.gnss.settings import GnssSettings
from onboard.obd.can_frame import CanFrame
from onboard.observations import Sensor
from onboard.recorder.recorded import put_together
from onboard.security.authority import make_trial
from onboard.security.credentials import Credentials
from onboard.security.p256 import key_from
from onboard.settings import parse_settings
from onboard.trace import as_record
from onboard.wave_udp import psid
from sim_rig.cars.camera_model import CameraModel
from sim_rig.cars.camera_view import FPS, CameraView
from sim_rig.cars.crowd import CrowdedAir, crowd_names
from sim_rig.cars.faulty_ecu import FaultyEcu
from sim_rig.cars.gnss_receiver import GnssReceiver
from sim_rig.cars.vehicle_camera import VehicleCamera
from sim_rig.cars.vehicle_detector import VehicleDetector
from sim_rig.faults_of_car import FaultsOfCar
from sim_rig.radio.faulty_air import FaultyAir
from sim_rig.radio.models import open_air
from sim_rig.recorder import RigRecorder
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.roads.road import Road
from sim_rig.run_log import Record, RunLog
from sim_rig.scenario import Scenario
from sim_rig.truth import true_states
from sim_rig.virtual_box import VirtualBox
from sim_rig.wiring import car_config, gnss_config, names_by_id

START_UTC_S = 1_750_000_000.0
"""UTC when a virtual run begins: some time in June 2025, the same for every run."""
_MOST_STEPS = 10_000
"""At one moment. Between events no time passes, so a timer that is always due would stop it."""


def run_virtual(
    scenario: Scenario, seed: int | None = None, box_folder: Path | None = None
) -> RunLog:
    """Run the scenario; `seed` in the place of its own.

    Each car's black box writes into a folder of its own below `box_folder`, if there is one.
    """
    chosen = scenario.seed if seed is None else seed
    boxes = (
        {name: VirtualBox(box_folder / name) for name in scenario.equipped} if box_folder else {}
    )
    run = _VirtualRun(scenario, chosen, boxes)
    run.run()
    for box in boxes.values():
        box.close(scenario.duration_s)
    return RunLog(
        start_s=0.0,
        traces={car.name: car.trace for car in run.cars.values()},
        rig=[
            *run.recorder.records,
            *true_states(BreakpointRoad(scenario), 0.0, scenario.duration_s),
        ],
        names=names_by_id(scenario, START_UTC_S, START_UTC_S + scenario.duration_s),
    )


class _VirtualRun:
    """The clock, and what is due when."""

    def __init__(self, scenario: Scenario, seed: int, boxes: Mapping[str, VirtualBox]) -> None:
        self._scenario = scenario
        self.recorder = RigRecorder()
        road = BreakpointRoad(scenario)
        air_seed, *car_seeds, sky_seed, keys_seed = np.random.SeedSequence(seed).spawn(
            3 + len(scenario.equipped)
        )
        credentials: Mapping[str, Credentials] = {}
        if scenario.signed:
            new_key = key_from(np.random.default_rng(keys_seed))
            psids = {psid.BSM, psid.LCCA}
            cars = [*scenario.equipped, *crowd_names(scenario)]
            credentials = make_trial(cars, psids, START_UTC_S, new_key)
        air_rng = np.random.default_rng(air_seed)
        air = FaultyAir(
            open_air(scenario.radio, road.cars_at, scenario.equipped, air_rng),
            scenario,
            lambda now: now,
            START_UTC_S,
            credentials,
        )
        self._air = CrowdedAir(air, scenario, now=0.0, utc_s=START_UTC_S, credentials=credentials)
        self._air_planned_at = math.inf
        self.cars = {
            name: _VirtualCar(
                scenario,
                road,
                name,
                car_seed,
                sky_seed,
                box=boxes.get(name),
                credentials=credentials.get(name),
            )
            for name, car_seed in zip(scenario.equipped, car_seeds, strict=True)
        }
        self._agenda: list[tuple[float, int, _VirtualCar | None]] = []
        self._order = count()

    def run(self) -> None:
        """Do everything that is due until the scenario ends."""
        for car in self.cars.values():
            self._settle(car, 0.0)
        last_s, steps = -1.0, 0
        while self._agenda and self._agenda[0][0] <= self._scenario.duration_s:
            now, _, due = heapq.heappop(self._agenda)
            steps = steps + 1 if now == last_s else 0
            if steps > _MOST_STEPS:
                raise RuntimeError(f"a core wants to be called for ever at {now} s")
            last_s = now
            if due is None:
                self._deliver(now)
            elif due.planned_at == now:
                due.planned_at = math.inf
                for frame in due.handle_timer(now):
                    self.recorder.note_answer(due.name, frame)
                self._settle(due, now)

    def _deliver(self, now: float) -> None:
        self._air_planned_at = math.inf
        for delivery in self._air.wsms_to_deliver(now):
            self.recorder.note_delivery(delivery, now)
            car = self.cars[delivery.receiver]
            car.receive_wsm(delivery.wsm, now)
            self._settle(car, now)
        self._plan_air()

    def _settle(self, car: "_VirtualCar", now: float) -> None:
        """Carry away what a car sends, and plan when it wants to be called again."""
        for user_priority, wsm in [] if car.is_asleep(now) else car.wsms_to_send(now):
            self.recorder.note_on_air(car.name, wsm, user_priority, now)
            self._air.receive_wsm(car.name, wsm, user_priority, now)
        self._plan_air()
        at = max(car.get_timer(), now)
        if at != car.planned_at:
            # What was planned before stays on the agenda, and is passed over when it comes up.
            car.planned_at = at
            heapq.heappush(self._agenda, (at, next(self._order), car))

    def _plan_air(self) -> None:
        at = self._air.get_timer()
        if at is not None and at < self._air_planned_at:
            self._air_planned_at = at
            heapq.heappush(self._agenda, (at, next(self._order), None))


class _VirtualCar:
    """One car's stack with the rig's ends of its wires held against it."""

    def __init__(
        self,
        scenario: Scenario,
        road: Road,
        name: str,
        seed: np.random.SeedSequence,
        sky_seed: np.random.SeedSequence,
        *,
        box: VirtualBox | None,
        credentials: Credentials | None,
    ) -> None:
        self.name = name
        self.trace: list[Record] = []
        self.planned_at = math.inf
        self._stack_at = 0.0
        own_seed, *other_seeds = seed.spawn(5)
        camera_rng, *others = (np.random.default_rng(each) for each in other_seeds)
        config = parse_settings(car_config(scenario, name, seed=0), CarConfig, name)
        sensors = {
            Sensor.SPEED,
            Sensor.CAMERA,
            *([Sensor.POSITION] if scenario.gnss else []),
            *([Sensor.DETECTOR] if scenario.detector else []),
        }
        self._faults = FaultsOfCar(scenario, name)
        self._stack = put_together(
            box,
            config,
            frozenset(sensors),
            own_seed,
            now=0.0,
            utc_s=START_UTC_S + self._faults.clock_error_s(0.0),
            credentials=credentials,
        )
        self._waiting: deque[bytes] = deque()
        phase_s = scenario.equipped.index(name) / FPS / len(scenario.equipped)
        self._camera = CameraModel(
            CameraView(scenario, road, name, camera_rng), config.vision, phase_s, camera_rng
        )
        gnss_rng, vehicles_rng, ecu_rng = others
        self._ecu = FaultyEcu(
            scenario,
            name,
            speed_m_s=lambda now: road.car_at(name, now).speed_m_s,
            at_s=lambda now: now,
            rng=ecu_rng,
        )
        self._detector: VehicleDetector | None = None
        if scenario.detector is not None:
            self._object_lists = ObjectListReader()
            vehicles = VehicleCamera(scenario.detector, name, road.cars_at, vehicles_rng)
            self._detector = VehicleDetector(vehicles, phase_s)
        self._receiver: GnssReceiver | None = None
        if scenario.gnss is not None:
            self._gnss = NmeaReader(GnssSettings.model_validate(gnss_config(scenario.gnss)))
            self._receiver = GnssReceiver(
                scenario.gnss,
                lambda now: self._faults.received(road.car_at(name, now), now),
                START_UTC_S,
                gnss_rng,
                np.random.default_rng(sky_seed),
            )

    def get_timer(self) -> float:
        """When something of this car is next due."""
        ecu_at = self._ecu.get_timer()
        self._stack_at = self._stack.get_timer()
        camera_at = self._camera.get_timer()
        devices = [each for each in (self._receiver, self._detector) if each is not None]
        at = min(self._stack_at, camera_at, *(device.get_timer() for device in devices))
        return self._faults.wakes_at(at if ecu_at is None else min(at, ecu_at))

    def is_asleep(self, now: float) -> bool:
        """Whether something else has the processor."""
        return self._faults.wakes_at(now) > now

    def receive_wsm(self, wsm: bytes, now: float) -> None:
        """A frame arrives at the car's radio unit."""
        self._waiting.append(wsm)
        if not self.is_asleep(now):
            self._take_waiting(now)

    def handle_timer(self, now: float) -> list[CanFrame]:
        """Do what is due; the frames that the ECU has put on the bus are returned."""
        self._take_waiting(now)
        answers = self._ecu.frames_to_send(now)
        for frame in answers:
            self._stack.receive_can(frame, now)
        self._camera.handle_timer(now)
        self._take_observations(self._camera, now)
        if self._receiver is not None:
            self._gnss.receive_bytes(self._receiver.bytes_to_send(now), now)
            self._take_observations(self._gnss, now)
        if self._detector is not None and (data := self._detector.bytes_to_send(now)):
            self._object_lists.receive_bytes(data, now)
            self._take_observations(self._object_lists, now)
        if self._stack_at <= now:
            self._stack.handle_timer(now)
        return answers

    def _take_observations(
        self, source: CameraModel | NmeaReader | ObjectListReader, now: float
    ) -> None:
        while (observation := source.next_event()) is not None:
            self._stack.receive_observation(observation, now)

    def _take_waiting(self, now: float) -> None:
        if self._faults.has_wrong_clock:
            self._stack.set_utc(START_UTC_S + now + self._faults.clock_error_s(now), now)
        while self._waiting:
            self._stack.receive_wsm(self._waiting.popleft(), now)

    def wsms_to_send(self, now: float) -> list[tuple[int, bytes]]:
        """What the radio unit is given to send; everything else is settled inside the car."""
        wsms = self._stack.wsms_to_send(now)
        for frame in self._stack.can_to_send(now):
            self._ecu.receive_frame(frame, now)
        while (event := self._stack.next_event()) is not None:
            self.trace.append(as_record(event))
        return wsms
