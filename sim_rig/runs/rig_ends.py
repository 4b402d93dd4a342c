"""The rig's ends of one car's wires: the same for a process as for a box."""

import time
from collections.abc import Callable
from contextlib import AsyncExitStack, closing
from functools import partial

import numpy as np

from onboard.errors import UserError
from onboard.obd.can_frame import CanFrame
from sim_rig.cars.brake_controller import BrakeController
from sim_rig.cars.can_interface import CanInterface
from sim_rig.cars.controller_line import open_controller_line
from sim_rig.cars.device_line import Device, DeviceLine, SerialLine, UdpLine
from sim_rig.cars.faulty_ecu import FaultyEcu
from sim_rig.cars.gnss_receiver import GnssReceiver
from sim_rig.cars.socketcand_server import SocketcandServer
from sim_rig.cars.vehicle_camera import VehicleCamera
from sim_rig.cars.vehicle_detector import ExternalDetector
from sim_rig.cars.vehicle_faults import VehicleFaults
from sim_rig.radio.iwcu import RadioUnits
from sim_rig.roads.road import CarState, Road, yaw_rate_rad_s
from sim_rig.run_log.lateness import Lateness
from sim_rig.run_log.rig_recorder import RigRecorder
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.wire_settings import BusWire, SatelliteWire, WireSettings

_SHARED_ERRORS = 1_000_000
"""Seed of the GNSS errors that all receivers share, in place of a car's number."""
_DETECTOR = 1
"""Seed of a vehicle detector's errors, beside the car's number."""


class RigEnds:
    """Opens ECU, radio unit, GNSS receiver and vehicle detector of each car.

    The cameras are a process of their own (`cars/camera_server.py`).
    """

    def __init__(
        self,
        scenario: Scenario,
        road: Road,
        at_s: Callable[[float], float],
        *,
        seed: int,
        recorder: RigRecorder,
        lateness: Lateness,
        brake: Callable[[str, float, float, float], None],
    ) -> None:
        """Open nothing yet.

        Args:
            scenario: the scenario of the run.
            road: source of the cars' states.
            at_s: time since the start of the scenario at a `now`, s.
            seed: seed of all random errors.
            recorder: records the ECUs' answers.
            lateness: collects how late the ends were.
            brake: lets a car brake that obeys requests; arguments as of `BreakpointRoad.brake`.
        """
        self._scenario = scenario
        self._road = road
        self._at_s = at_s
        self._seed = seed
        self._recorder = recorder
        self._lateness = lateness
        self._brake = brake

    async def open(
        self, car: str, wires: WireSettings, units: RadioUnits, edges: AsyncExitStack
    ) -> None:
        """Open the ends of one car's wires, until `edges` are closed.

        Raises:
            UserError: one of them cannot be opened.
        """
        number = self._scenario.equipped.index(car)
        try:
            await self._open_bus(car, wires.bus, edges)
            units.add(car, wires.radio)
            if self._scenario.cars[car].obeys_request and wires.controller is not None:
                controller = BrakeController(partial(self._brake, car))
                host, port = str(wires.controller.host), wires.controller.port
                line = await open_controller_line(controller, self._at_s, host, port)
                edges.callback(line.close)
        except OSError as error:
            raise UserError(f"{car}: {error.strerror}") from error
        if self._scenario.gnss is not None and wires.satellites is not None:
            receiver = self._receiver(car, number)
            self._start(receiver, _line(wires.satellites), "fix", edges)
        if self._scenario.detector is not None and wires.detector is not None:
            wire = UdpLine(wires.detector.host, wires.detector.port)
            self._start(self._detector(car, number), wire, "detection", edges)

    async def _open_bus(self, car: str, wire: BusWire, edges: AsyncExitStack) -> None:
        ecu = FaultyEcu(
            self._scenario,
            car,
            speed_m_s=lambda now: self._road.car_at(car, self._at_s(now)).speed_m_s,
            at_s=self._at_s,
            rng=np.random.default_rng(self._seed),
            yaw_rate_rad_s=lambda now: yaw_rate_rad_s(self._road, car, self._at_s(now)),
        )

        def record(frame: CanFrame) -> None:
            self._recorder.note_answer(car, frame)

        def note_late(late_s: float) -> None:
            self._lateness.note("ECU answer", late_s)

        if wire.interface != "socketcand":
            end = CanInterface(ecu, wire.serial or wire.channel, record, note_late)
            edges.enter_context(closing(end))
            return
        server = SocketcandServer(ecu, wire.channel, record, note_late)
        await server.start(wire.port, str(wire.host))
        edges.push_async_callback(server.close)

    def _start(
        self, device: Device, line: UdpLine | SerialLine, what: str, edges: AsyncExitStack
    ) -> None:
        def note_late(late_s: float) -> None:
            self._lateness.note(what, late_s)

        edges.enter_context(closing(DeviceLine(device, line, note_late)))

    def _receiver(self, car: str, number: int) -> GnssReceiver:
        settings = self._scenario.gnss
        assert settings is not None  # noqa: S101 (asked by `open`)
        faults = VehicleFaults(self._scenario, car)

        def state_at(now: float) -> CarState | None:
            at_s = self._at_s(now)
            return faults.received(self._road.car_at(car, at_s), at_s)

        return GnssReceiver(
            settings,
            state_at,
            time.time() - time.monotonic(),
            np.random.default_rng([self._seed, number]),
            np.random.default_rng([self._seed, _SHARED_ERRORS]),
        )

    def _detector(self, car: str, number: int) -> ExternalDetector:
        settings = self._scenario.detector
        assert settings is not None  # noqa: S101 (asked by `open`)
        camera = VehicleCamera(
            settings,
            car,
            lambda now: self._road.cars_at(self._at_s(now)),
            np.random.default_rng([self._seed, number, _DETECTOR]),
        )
        return ExternalDetector(camera, phase_s=0.0)


def _line(wire: SatelliteWire) -> UdpLine | SerialLine:
    if wire.serial is not None:
        return SerialLine(wire.serial)
    assert wire.port is not None  # noqa: S101 (one of the two is given)
    return UdpLine(wire.host, wire.port)
