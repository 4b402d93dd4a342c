"""The cars of a live run that are processes: a real daemon each, on 127.0.0.1."""

import shutil
import socket
from collections import Counter, defaultdict
from pathlib import Path

import yaml

from sim_rig.cars.camera_view import calibration
from sim_rig.processes.gpsd import start_gpsd
from sim_rig.processes.processes import Processes
from sim_rig.processes.wrong_clock import START_FILE
from sim_rig.run_log.run_log import Record, read_trace
from sim_rig.run_log.trace_reader import TraceReader
from sim_rig.scenario.car_config import car_config, gnss_config
from sim_rig.scenario.faults import WrongClock
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.wire_settings import (
    BusWire,
    CameraWire,
    ControllerWire,
    DetectorWire,
    RadioWire,
    SatelliteWire,
    WireSettings,
)

_RECORDS_WHEN_READY = frozenset({"ready", "speed", "lead"})


class Daemons:
    """Starts the daemons, cuts their power, and reads their traces."""

    def __init__(self, scenario: Scenario, seed: int, folder: Path, processes: Processes) -> None:
        """Start nothing yet.

        Args:
            scenario: the scenario of the run.
            seed: seed of all random errors.
            folder: for configurations, traces and recordings; `keys` in it has those of each car.
            processes: where the daemons become child processes.
        """
        self._scenario = scenario
        self._seed = seed
        self._folder = folder
        self._processes = processes
        self._cuts: Counter[str] = Counter()
        """Power cuts of each car up to now."""
        self._readers = {car: TraceReader(self._trace(car)) for car in scenario.equipped}
        self._traced: defaultdict[str, set[str]] = defaultdict(set)
        """Kinds of the records of each car up to its last call of `check_ready`."""
        self._ports: set[int] = set()
        """Given to a daemon, which may not have bound it yet."""

    def wires(self, camera_port: int) -> WireSettings:
        """Return wires of one car at free ports."""
        return WireSettings(
            bus=BusWire(port=self._free_port(socket.SOCK_STREAM)),
            camera=CameraWire(port=camera_port),
            radio=RadioWire(
                port=self._free_port(socket.SOCK_DGRAM), box_port=self._free_port(socket.SOCK_DGRAM)
            ),
            satellites=SatelliteWire(port=self._free_port(socket.SOCK_DGRAM)),
            detector=DetectorWire(port=self._free_port(socket.SOCK_DGRAM)),
            controller=ControllerWire(port=self._free_port(socket.SOCK_DGRAM)),
        )

    def _free_port(self, kind: socket.SocketKind) -> int:
        """Return a free port, which the rig or the daemon binds soon after, and no other."""
        while True:
            with socket.socket(socket.AF_INET, kind) as probe:
                probe.bind(("127.0.0.1", 0))
                port = int(probe.getsockname()[1])
            if port not in self._ports:
                self._ports.add(port)
                return port

    async def start(self, car: str, wires: WireSettings) -> str:
        """Start a daemon, without files of an earlier run, and return the address of its page.

        Raises:
            ProcessError: the scenario needs gpsd, which is not installed.
        """
        page_port = self._free_port(socket.SOCK_STREAM)
        # Cars with equal seeds would have equal temporary IDs.
        seed = 1000 * self._seed + self._scenario.equipped.index(car)
        config = car_config(self._scenario, car, seed) | self._interfaces(car, wires, page_port)
        if self._scenario.gnss is not None and wires.satellites is not None:
            gpsd_port = self._free_port(socket.SOCK_STREAM)
            assert wires.satellites.port is not None  # noqa: S101 (see `wires`)
            await start_gpsd(self._processes, car, gpsd_port, wires.satellites.port)
            config["gnss"] = gnss_config(self._scenario.gnss) | {"port": gpsd_port}
        config["security"]["keys_folder"] = str(self._folder / "keys" / car)
        config_file = self._folder / f"{car}.yaml"
        config_file.write_text(yaml.safe_dump(config, sort_keys=False), encoding="utf-8")
        self._trace(car).unlink(missing_ok=True)
        shutil.rmtree(self._recording(car), ignore_errors=True)
        await self.restore(car)
        return f"http://127.0.0.1:{page_port}/"

    async def cut(self, car: str) -> None:
        """End the daemon of `car` as a power cut does, and keep what it wrote."""
        await self._processes.kill(car)
        self._cuts[car] += 1
        for file in (self._trace(car), self._capture(car)):
            if file.exists():
                file.rename(_of_start(file, self._cuts[car]))

    async def restore(self, car: str) -> None:
        """Start the daemon of `car` anew."""
        config_file = self._folder / f"{car}.yaml"
        await self._processes.start(car, *self._program(car), "run", str(config_file))

    def check_ready(self, car: str) -> bool:
        """Read on in the trace of `car`; return whether it is ready and receives its sensors."""
        self._traced[car] |= {record["kind"] for record in self._readers[car].records()}
        position = {"position"} if self._scenario.gnss else set()
        return self._traced[car] >= _RECORDS_WHEN_READY | position

    def trace(self, car: str) -> list[Record]:
        """Return the trace of `car` up to now, of all starts of its daemon."""
        last = self._trace(car)
        files = [*(_of_start(last, 1 + n) for n in range(self._cuts[car])), last]
        return [record for file in files if file.exists() for record in read_trace(file)]

    def _interfaces(self, car: str, wires: WireSettings, page_port: int) -> dict[str, object]:
        """Return the daemon's settings for its wires."""
        interfaces: dict[str, object] = {
            "can": {"channel": wires.bus.channel, "port": wires.bus.port},
            "camera": {"source": f"http://127.0.0.1:{wires.camera.port}/{car}"}
            | calibration(self._scenario.lens).model_dump(),
            "radio": {
                "endpoint": "iwcu",
                "profile": self._scenario.profile.value,
                "listen_port": wires.radio.box_port,
                "unit_port": wires.radio.port,
            },
            "hmi": {"port": page_port, "brake_button": True},
            "trace": {"file": str(self._trace(car)), "capture": str(self._capture(car))},
            "recorder": {"folder": str(self._recording(car)), "segment_s": 3600.0},
        }
        if self._scenario.cars[car].obeys_request and wires.controller is not None:
            interfaces["brake_request"] = {"udp": {"port": wires.controller.port}}
        if self._scenario.detector is not None and wires.detector is not None:
            interfaces["detector"] = {"port": wires.detector.port}
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

    def _recording(self, car: str) -> Path:
        return self._folder / "box" / car

    def _trace(self, car: str) -> Path:
        return self._folder / f"{car}.jsonl"

    def _capture(self, car: str) -> Path:
        return self._folder / f"{car}.pcap"


class DaemonPower:
    """Power of one daemon's computer."""

    def __init__(self, daemons: Daemons, car: str) -> None:
        self._daemons = daemons
        self._car = car

    async def cut(self) -> None:
        """See `Daemons.cut`."""
        await self._daemons.cut(self._car)

    async def restore(self) -> None:
        """See `Daemons.restore`."""
        await self._daemons.restore(self._car)


def _of_start(file: Path, number: int) -> Path:
    """Name of a file that a daemon wrote from its start `number` to a power cut."""
    return file.with_stem(f"{file.stem}-{number}")
