"""Runs a scenario with real daemons, one process per car, on localhost.

The rig is the other end of each interface: a socketcand server with an ECU for each bus, an MJPEG
server for the cameras (a process of its own), and a UDP radio unit for each car with the channel
between them. A daemon's configuration has its own plate and ports, and nothing of other cars. GNSS
receivers of a scenario each feed a real gpsd.
"""

import asyncio
import json
import shutil
import socket
import time
from contextlib import AsyncExitStack
from functools import partial
from pathlib import Path

import numpy as np
import yaml

from onboard import psid
from onboard.obd.can_frame import CanFrame
from onboard.security.key_files import write_credentials
from onboard.tools.test_ca.authority import make_trial
from sim_rig.cars.background_traffic import BackgroundTraffic, background_names
from sim_rig.cars.brake_controller import BrakeController
from sim_rig.cars.camera_view import calibration
from sim_rig.cars.controller_line import open_controller_line
from sim_rig.cars.faulty_ecu import FaultyEcu
from sim_rig.cars.gnss_receiver import GnssReceiver
from sim_rig.cars.socketcand_server import SocketcandServer
from sim_rig.cars.udp_line import UdpLine
from sim_rig.cars.vehicle_camera import VehicleCamera
from sim_rig.cars.vehicle_detector import ExternalDetector
from sim_rig.cars.vehicle_faults import VehicleFaults
from sim_rig.engineer.page_process import ENGINEER, EngineerPage
from sim_rig.processes.gpsd import start_gpsd
from sim_rig.processes.processes import ProcessError, Processes
from sim_rig.processes.slow_cpu import slow_down
from sim_rig.processes.wrong_clock import START_FILE
from sim_rig.radio.air import Air
from sim_rig.radio.faulty_air import FaultyAir
from sim_rig.radio.iwcu import RadioUnits
from sim_rig.road_side.road_side_unit import open_channel, road_side_units
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.roads.road import CarState
from sim_rig.run_log.rig_recorder import RigRecorder
from sim_rig.run_log.run_log import RunLog, read_trace
from sim_rig.runs.car_states import car_state_records
from sim_rig.scenario.car_config import car_config, gnss_config, names_by_id
from sim_rig.scenario.faults import WrongClock
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.sensor_settings import ReceiverSettings, VehicleCameraSettings

_READY_WITHIN_S = 40.0
_EXTRA_S = 0.5
"""Time after the scenario's end, for messages and records in transit."""
_RECORDS_WHEN_READY = frozenset({"ready", "speed", "lead"})
_SHARED_ERRORS = 1_000_000
"""Seed of the GNSS errors that all receivers share, in place of a car's number."""
_DETECTOR = 1
"""Seed of a vehicle detector's errors, beside the car's number."""


class LiveTestbench:
    """The daemons of a scenario, and the rig's ends of their interfaces.

    An asynchronous context. Configurations, logs, traces and recordings are written to `folder`.
    """

    def __init__(self, scenario: Scenario, seed: int, folder: Path) -> None:
        """Prepare `folder`.

        Args:
            scenario: the scenario to run.
            seed: seed of all random errors.
            folder: folder for all files of the run.
        """
        folder.mkdir(parents=True, exist_ok=True)
        (folder / START_FILE).unlink(missing_ok=True)
        self.recorder = RigRecorder()
        self.processes = Processes(folder)
        self.start_s = float("inf")
        self.pages: dict[str, str] = {}
        """Address of each page by its car, and of the engineer's page."""
        self._start_utc_s = time.time()
        self._scenario = scenario
        self._seed = seed
        self._folder = folder
        self._keys = folder / "keys"
        self._road = BreakpointRoad(scenario)
        self._open = AsyncExitStack()

    async def __aenter__(self) -> "LiveTestbench":
        try:
            await self._set_up()
        except BaseException:
            await self._open.aclose()
            raise
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._open.aclose()

    async def run(self) -> None:
        """Start the scenario when all daemons are ready, and return at its end.

        Raises:
            ProcessError: a daemon did not get ready, or ended unexpectedly.
        """
        await self._until_ready()
        self.start_s = time.monotonic()
        (self._folder / START_FILE).write_text(repr(self.start_s), encoding="utf-8")
        slowing = asyncio.create_task(slow_down(self._scenario, self.start_s, self.processes))
        assert self._cameras.stdin is not None  # noqa: S101 (started with pipes)
        self._cameras.stdin.write(f"{self.start_s}\n".encode())
        self._engineer.begin(self.start_s)
        try:
            end_at = self.start_s + self._scenario.duration_s + _EXTRA_S
            await self.processes.sleep_until(end_at)
        finally:
            slowing.cancel()
            await asyncio.gather(slowing, return_exceptions=True)
        await self.processes.stop(*self._scenario.equipped)

    def log(self) -> RunLog:
        """Return the run log; call it after the end of the context."""
        return RunLog(
            start_s=self.start_s,
            traces={car: read_trace(self._trace(car)) for car in self._scenario.equipped},
            rig=[
                *self.recorder.records,
                *car_state_records(self._road, self.start_s, self._scenario.duration_s),
            ],
            names=names_by_id(self._scenario, self._start_utc_s, time.time()),
        )

    async def _set_up(self) -> None:
        self._make_keys()
        camera_port = await self._start_cameras()
        units = RadioUnits(self._air(), self.recorder, self._has_mute_radio)
        self._open.callback(units.close)
        for number, car in enumerate(self._scenario.equipped):
            await self._start_car(car, number, camera_port, units)
        self._engineer = await EngineerPage.open(
            self.processes, self._scenario_file, self._folder, camera_port
        )
        self._engineer.link(self.pages)
        self.pages = {ENGINEER: self._engineer.address} | self.pages
        self._open.callback(asyncio.create_task(self._engineer.follow(self.recorder)).cancel)

    async def _start_car(self, car: str, number: int, camera_port: int, units: RadioUnits) -> None:
        """Start a daemon with its interfaces, without files of an earlier run."""
        interfaces = await self._interfaces(car, number, camera_port, units)
        seed = 1000 * self._seed + number  # cars with equal seeds would have equal temporary IDs
        config = car_config(self._scenario, car, seed) | interfaces
        config["security"]["keys_folder"] = str(self._keys / car)
        config_file = self._folder / f"{car}.yaml"
        config_file.write_text(yaml.safe_dump(config, sort_keys=False), encoding="utf-8")
        self._trace(car).unlink(missing_ok=True)
        shutil.rmtree(self._recordings_folder(car), ignore_errors=True)
        await self.processes.start(car, *self._program(car), "run", str(config_file))

    async def _interfaces(
        self, car: str, number: int, camera_port: int, units: RadioUnits
    ) -> dict[str, object]:
        """Open the rig's ends of a car's interfaces, and return the daemon's settings for them."""
        listen_port, page_port = _free_port(socket.SOCK_DGRAM), _free_port(socket.SOCK_STREAM)
        self.pages[car] = f"http://127.0.0.1:{page_port}/"
        interfaces: dict[str, object] = {
            "can": {"channel": "can0", "port": await self._start_bus(car)},
            "camera": {"source": f"http://127.0.0.1:{camera_port}/{car}"}
            | calibration(self._scenario.lens).model_dump(),
            "radio": {
                "endpoint": "iwcu",
                "listen_port": listen_port,
                "unit_port": units.add(car, listen_port),
            },
            "hmi": {"port": page_port, "brake_button": True},
            "trace": {"file": str(self._trace(car)), "capture": str(self._folder / f"{car}.pcap")},
            "recorder": {"folder": str(self._recordings_folder(car)), "segment_s": 3600.0},
        }
        if self._scenario.gnss is not None:
            interfaces["gnss"] = await self._start_gnss(car, number, self._scenario.gnss)
        if self._scenario.cars[car].obeys_request:
            interfaces["brake_request"] = await self._start_controller(car)
        if self._scenario.detector is not None:
            interfaces["detector"] = self._start_detector(car, number, self._scenario.detector)
        return interfaces

    def _program(self, car: str) -> list[str]:
        """Python arguments of the daemon, with a wrong clock if the scenario has one."""
        clocks = [
            fault
            for fault in self._scenario.faults
            if isinstance(fault, WrongClock) and fault.car == car
        ]
        if not clocks:
            return ["-m", "onboard"]
        start_file = self._folder / START_FILE
        faults = [fault.model_dump_json() for fault in clocks]
        return ["-m", "sim_rig.processes.wrong_clock", str(start_file), str(len(faults)), *faults]

    def _make_keys(self) -> None:
        """Write certificates of one authority for every car: live messages are always signed."""
        shutil.rmtree(self._keys, ignore_errors=True)
        self._keys.mkdir(mode=0o700)
        psids = {psid.BSM, psid.LCCA}
        self._trial = make_trial(
            [*self._scenario.equipped, *background_names(self._scenario)],
            psids,
            self._start_utc_s,
            road_side_units=road_side_units(self._scenario),
        )
        for car in self._scenario.equipped:
            write_credentials(self._keys / car, self._trial[car])

    async def _start_cameras(self) -> int:
        """Start the process of the cameras, and return its port."""
        await self._open.enter_async_context(self.processes)
        self._scenario_file = self._folder / "scenario.json"
        self._scenario_file.write_text(self._scenario.model_dump_json(), encoding="utf-8")
        self._cameras = await self.processes.start(
            "cameras",
            *("-m", "sim_rig.cars.camera_server", str(self._scenario_file), str(self._seed)),
            with_pipes=True,
        )
        assert self._cameras.stdout is not None  # noqa: S101 (started with pipes)
        line = await self._cameras.stdout.readline()
        if not line:
            reason = self.processes.last_log_line("cameras")
            raise ProcessError(f"the cameras do not start: {reason}")
        return int(line)

    async def _start_bus(self, car: str) -> int:
        """Serve a bus with an ECU, and return its port."""

        def record(frame: CanFrame) -> None:
            self.recorder.note_answer(car, frame)

        ecu = FaultyEcu(
            self._scenario,
            car,
            speed_m_s=lambda now: self._road.car_at(car, self._at_s(now)).speed_m_s,
            at_s=self._at_s,
            rng=np.random.default_rng(self._seed),
        )
        server = SocketcandServer(ecu, "can0", record)
        port = await server.start()
        self._open.push_async_callback(server.close)
        return port

    async def _start_gnss(
        self, car: str, number: int, settings: ReceiverSettings
    ) -> dict[str, object]:
        """Start a receiver with its gpsd, and return the daemon's settings for them."""
        port, nmea_port = _free_port(socket.SOCK_STREAM), _free_port(socket.SOCK_DGRAM)
        await start_gpsd(self.processes, car, port, nmea_port)

        faults = VehicleFaults(self._scenario, car)

        def state_at(now: float) -> CarState | None:
            at_s = self._at_s(now)
            return faults.received(self._road.car_at(car, at_s), at_s)

        receiver = GnssReceiver(
            settings,
            state_at,
            time.time() - time.monotonic(),
            np.random.default_rng([self._seed, number]),
            np.random.default_rng([self._seed, _SHARED_ERRORS]),
        )
        self._open.callback(UdpLine(receiver, nmea_port).close)
        return gnss_config(settings) | {"port": port}

    def _start_detector(
        self, car: str, number: int, settings: VehicleCameraSettings
    ) -> dict[str, object]:
        """Start a vehicle detector, and return the daemon's settings for it."""
        port = _free_port(socket.SOCK_DGRAM)
        camera = VehicleCamera(
            settings,
            car,
            lambda now: self._road.cars_at(self._at_s(now)),
            np.random.default_rng([self._seed, number, _DETECTOR]),
        )
        self._open.callback(UdpLine(ExternalDetector(camera, phase_s=0.0), port).close)
        return {"port": port}

    async def _start_controller(self, car: str) -> dict[str, object]:
        """Start a controller that obeys requests to brake, and return the settings for it."""
        controller = BrakeController(partial(self._brake, car))
        line, port = await open_controller_line(controller, self._at_s)
        self._open.callback(line.close)
        return {"udp": {"port": port}}

    def _brake(self, car: str, begin_s: float, until_s: float, deceleration_m_s2: float) -> None:
        """Let a car brake, also in the pictures of the cameras."""
        self._road.brake(car, begin_s, until_s, deceleration_m_s2)
        assert self._cameras.stdin is not None  # noqa: S101 (started with pipes)
        braking = [car, begin_s, until_s, deceleration_m_s2]
        self._cameras.stdin.write(f"{json.dumps(braking)}\n".encode())

    def _has_mute_radio(self, car: str, now: float) -> bool:
        return self._scenario.has_fault("radio_mute", car, self._at_s(now))

    def _air(self) -> Air:
        utc_offset_s = time.time() - time.monotonic()
        air = open_channel(
            self._scenario,
            lambda now: self._road.cars_at(self._at_s(now)),
            self._at_s,
            np.random.default_rng(self._seed),
            now=time.monotonic(),
            utc_s=time.time(),
            credentials=self._trial,
        )
        return BackgroundTraffic(
            FaultyAir(air, self._scenario, self._at_s, utc_offset_s, self._trial),
            self._scenario,
            now=time.monotonic(),
            utc_s=time.time(),
            credentials=self._trial,
        )

    async def _until_ready(self) -> None:
        """Wait until every daemon is ready and receives its sensors."""
        give_up_at = time.monotonic() + _READY_WITHIN_S
        waiting = self._scenario.equipped
        while waiting := [car for car in waiting if not self._is_ready(car)]:
            if time.monotonic() > give_up_at:
                raise ProcessError(
                    f"not ready after {_READY_WITHIN_S:g} s: {', '.join(waiting)};"
                    f" see {self._folder}"
                )
            await self.processes.sleep_until(time.monotonic() + 0.1)

    def _is_ready(self, car: str) -> bool:
        if not self._trace(car).exists():
            return False
        kinds = {record["kind"] for record in read_trace(self._trace(car))}
        return kinds >= _RECORDS_WHEN_READY | ({"position"} if self._scenario.gnss else set())

    def _at_s(self, now: float) -> float:
        """Time since the start of the scenario, s; 0 before it."""
        return max(0.0, now - self.start_s)

    def _recordings_folder(self, car: str) -> Path:
        return self._folder / "box" / car

    def _trace(self, car: str) -> Path:
        return self._folder / f"{car}.jsonl"


def _free_port(kind: socket.SocketKind) -> int:
    """Return a free port, which the daemon binds soon after."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
