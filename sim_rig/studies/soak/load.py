"""One real daemon behind a vehicle that brakes repeatedly, without and with background traffic.

The lead vehicle is a stack in this process, and the daemon's other inputs are as cheap as possible,
so that the daemon and the background traffic (`bsm_load.py`) have the processor. All show one drive
(`braking_lead.py`): who says that he brakes, and does not in the picture, is not the lead.
"""

import asyncio
import contextlib
import itertools
import json
import os
import socket
import sys
import time
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import AsyncExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from onboard.obd.braking import Braking
from onboard.obd.settings import ObdSettings
from onboard.observations import HardBrake, Position, Speed
from onboard.security.credentials import Credentials
from onboard.security.key_files import write_credentials
from onboard.settings import parse_settings
from onboard.step import Input, ReceivedWsm
from onboard.tools.test_ca.authority import KnownPlate, make_trial
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from onboard.vision.settings import CameraSettings
from onboard.wave_udp import psid
from sim_rig.cars.camera_view import SMALL_LENS
from sim_rig.cars.ecu import Ecu
from sim_rig.cars.socketcand_server import SocketcandServer
from sim_rig.processes.processes import ProcessError, Processes
from sim_rig.rendering.scene import CameraRenderer, Scene, SceneCar
from sim_rig.run_log.latency_ledger import alarm_stamp_s
from sim_rig.run_log.run_log import Record, read_trace
from sim_rig.scenario.car_config import DIGEST, plate_digest
from sim_rig.studies.soak.braking_lead import (
    HOST_M_S,
    LARGEST_GAP_M,
    LEAST_GAP_M,
    PERIOD_S,
    BrakingLead,
)
from sim_rig.studies.soak.bsm_load import LATITUDE_DEG, LONGITUDE_DEG

GROUP_WITHIN_S, SETTLE_S = 60.0, 2.0
LONGEST_UNLOADED_S = 60.0
STEP_S = 0.05
REMOTE_VEHICLES = 300
IMAGES_HZ, FIXES_HZ = 10.0, 10.0
TAG_M = 0.4
GAP_STEP_M = 0.02
"""Between the gaps of which there are images."""
VIEWS = 4
"""Images of each gap: a camera that shows the same again has frozen."""
_VIEW = SMALL_LENS.model_dump()
_DEG_PER_M = 1.0 / 111_000
Handler = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


@dataclass(frozen=True, slots=True)
class Load:
    """Result of the load test."""

    sent: int
    """Datagrams of the background traffic."""
    dropped_by_kernel: int
    discarded: int
    """Datagrams discarded by the daemon because its queue was full or newer ones replaced them."""
    unloaded_ms: list[float]
    """Time from the sending of a warning to the alarm, without background traffic."""
    loaded_ms: list[float]
    """The same with background traffic."""
    due: tuple[int, int]
    """Warnings sent, without and with background traffic."""
    cores: tuple[float, float]
    """Processor cores used by the daemon, without and with background traffic."""


async def load(folder: Path, rate_hz: float, during_s: float) -> Load:
    """Drive without background traffic, for a minute at most, and then with it.

    Args:
        folder: of keys, configuration and trace.
        rate_hz: datagrams a second of the background traffic.
        during_s: duration with background traffic.

    Raises:
        ProcessError: no warning group has formed, or the daemon has ended.
    """
    unloaded_s = min(during_s, LONGEST_UNLOADED_S)
    async with AsyncExitStack() as open_wires:
        testbench = await _DaemonTestbench.set_up(folder, open_wires)
        driving = asyncio.create_task(testbench.lead.drive())
        give_up_at = time.monotonic() + GROUP_WITHIN_S
        while not testbench.lead.is_followed:
            await testbench.processes.sleep_until(time.monotonic() + 0.1)
            if time.monotonic() > give_up_at:
                raise ProcessError(f"no group after {GROUP_WITHIN_S:g} s; see {folder}")
        unloaded_at = time.monotonic() + SETTLE_S
        loaded_at = unloaded_at + unloaded_s
        end_at = loaded_at + during_s
        testbench.road.brakes_from_at = unloaded_at
        background = await asyncio.create_subprocess_exec(
            *(
                sys.executable,
                "-m",
                "sim_rig.studies.soak.bsm_load",
                str(testbench.port),
                f"{rate_hz:g}",
            ),
            *(f"{during_s:g}", f"{loaded_at}", str(folder / "background")),
            stdout=asyncio.subprocess.PIPE,
        )
        used_s = []
        for at in (unloaded_at, loaded_at, end_at):
            await testbench.processes.sleep_until(at)
            used_s.append(processor_s(testbench.processes.pid("car")))
        sent, _ = await background.communicate()
        dropped = _dropped_by_kernel(testbench.port)
        driving.cancel()
    trace = list(read_trace(folder / "trace.jsonl"))
    unloaded, loaded = (
        [at for at in testbench.lead.warned_at if begin <= at < end]
        for begin, end in ((unloaded_at, loaded_at), (loaded_at, end_at))
    )
    return Load(
        int(sent),
        dropped,
        sum(int(each["detail"].split()[0]) for each in trace if each.get("reason") == "overload"),
        list(_delays_ms(trace, unloaded)),
        list(_delays_ms(trace, loaded)),
        (len(unloaded), len(loaded)),
        ((used_s[1] - used_s[0]) / unloaded_s, (used_s[2] - used_s[1]) / during_s),
    )


class _LeadVehicle:
    """The cores of the lead vehicle, with their own wire to the daemon."""

    def __init__(
        self, road: BrakingLead, credentials: Credentials, unit: socket.socket, port: int
    ) -> None:
        self.warned_at: list[float] = []
        """Times at which warnings of a new braking were sent."""
        self._road = road
        self._unit, self._port = unit, port
        self._stack = Stack(
            parse_settings(_config("TAG1"), CarConfig, "ahead"),
            (),
            np.random.default_rng(1),
            now=time.monotonic(),
            utc_s=time.time(),
            credentials=credentials,
        )
        self._braking = Braking(ObdSettings().hard_brake_threshold_g)
        self._brakes = False
        unit.setblocking(False)
        asyncio.get_running_loop().add_reader(unit, self._receive)

    @property
    def is_followed(self) -> bool:
        """Whether the daemon's car has joined."""
        return bool(self._stack.group.followers)

    async def drive(self) -> None:
        """Drive until cancelled."""
        at = time.monotonic()
        while True:
            speed = Speed(at, self._road.lead_m_s(at), 0.1, "ahead")
            observations: list[Input] = [speed, _fix(at, self._road.lead_m(at), speed.speed_m_s)]
            self._braking.receive_speed(speed, at)
            observations += iter(self._braking.next_event, None)
            self._step(*observations)
            at += STEP_S
            await asyncio.sleep(max(0.0, at - time.monotonic()))

    def _receive(self) -> None:
        self._step(ReceivedWsm(time.monotonic(), self._unit.recv(8192)))

    def _step(self, *inputs: Input) -> None:
        now = time.monotonic()
        outputs = self._stack.step(inputs, now, time.time())
        sent_at = time.monotonic()
        for wsm in outputs.wsms:
            self._unit.sendto(wsm.data, ("127.0.0.1", self._port))
        for event in outputs.events:
            if isinstance(event, HardBrake):
                if not self._brakes:
                    self.warned_at.append(sent_at)
                self._brakes = not event.is_over


def _fix(now: float, place_m: float, speed_m_s: float) -> Position:
    latitude_deg = LATITUDE_DEG + place_m * _DEG_PER_M
    return Position(now, latitude_deg, LONGITUDE_DEG, 0.0, 1.5, speed_m_s, 0.0)


def _config(plate: str) -> dict[str, Any]:
    return {"car": {"plate": plate}, "security": {"plate_digest": DIGEST}}


@dataclass(frozen=True, slots=True)
class _DaemonTestbench:
    """The daemon with the other ends of its wires."""

    road: BrakingLead
    lead: _LeadVehicle
    processes: Processes
    port: int
    """UDP port on which the daemon receives from its radio unit."""

    @classmethod
    async def set_up(cls, folder: Path, wires: AsyncExitStack) -> "_DaemonTestbench":
        """Start the daemon and all its inputs."""
        utc_s, psids = time.time(), {psid.BSM, psid.LCCA}
        digest = plate_digest()
        trial = make_trial(
            ["own", "ahead", "background"],
            psids,
            utc_s,
            pseudonyms=REMOTE_VEHICLES,
            plates={"own": KnownPlate("TAG2", digest), "ahead": KnownPlate("TAG1", digest)},
        )
        for name in ("own", "background"):
            write_credentials(folder / name, trial[name])
        road = BrakingLead(time.monotonic())
        bus = SocketcandServer(Ecu(lambda _now: HOST_M_S), "can0", lambda _frame: None)
        bus_port = await bus.start()
        wires.push_async_callback(bus.close)
        ports = []
        for serve in (_camera_server(road), _fixes_server(road)):
            server = await asyncio.start_server(serve, "127.0.0.1", 0)
            wires.callback(server.close)
            ports.append(server.sockets[0].getsockname()[1])
        unit = wires.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        unit.bind(("127.0.0.1", 0))
        port = free_port()
        config = _config("TAG2") | {
            "can": {"channel": "can0", "port": bus_port},
            "camera": _VIEW | {"source": f"http://127.0.0.1:{ports[0]}/"},
            "vision": {"plates": False, "tag_side_m": TAG_M},
            "gnss": {"port": ports[1]},
            "radio": {
                "endpoint": "iwcu",
                "listen_port": port,
                "unit_port": unit.getsockname()[1],
            },
            "trace": {"file": str(folder / "trace.jsonl")},
            "recorder": {"folder": str(folder / "recorder")},
        }
        config["security"]["keys_folder"] = str(folder / "own")
        (folder / "car.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
        processes = await wires.enter_async_context(Processes(folder))
        await processes.start("car", "-m", "onboard", "run", str(folder / "car.yaml"))
        return cls(road, _LeadVehicle(road, trial["ahead"], unit, port), processes, port)


def _camera_server(road: BrakingLead) -> Handler:
    """Serve MJPEG of the lead vehicle with a tag, from images rendered before, one for each gap."""
    renderer = CameraRenderer(CameraSettings(source="rig", **_VIEW))
    rng = np.random.default_rng(1)
    gaps_m = np.arange(LEAST_GAP_M, LARGEST_GAP_M + GAP_STEP_M, GAP_STEP_M)
    jpegs = [[_jpeg(renderer, gap_m, 1.4 * n, rng) for n in range(VIEWS)] for gap_m in gaps_m]

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        kind = b"multipart/x-mixed-replace; boundary=image"
        writer.write(b"HTTP/1.1 200 OK\r\nContent-Type: " + kind + b"\r\n\r\n")
        # Without this, a cancelled stream would be logged.
        with contextlib.closing(writer), contextlib.suppress(asyncio.CancelledError):
            for number in itertools.count():
                if writer.is_closing():
                    break
                gap_m = road.gap_m(time.monotonic())
                jpeg = jpegs[round((gap_m - LEAST_GAP_M) / GAP_STEP_M)][number % VIEWS]
                head = b"--image\r\nContent-Length: %d\r\n\r\n" % len(jpeg)
                writer.write(head + jpeg + b"\r\n")
                await asyncio.sleep(1 / IMAGES_HZ)

    return serve


def _jpeg(
    renderer: CameraRenderer, gap_m: float, travelled_m: float, rng: np.random.Generator
) -> bytes:
    ahead = SceneCar(ahead_m=gap_m, tag_id=1, tag_side_m=TAG_M)
    image = renderer.draw(Scene(cars=(ahead,), travelled_m=travelled_m), rng)
    return cv2.imencode(".jpg", image)[1].tobytes()


def _fixes_server(road: BrakingLead) -> Handler:
    """Serve the host vehicle's fixes as gpsd does."""

    async def serve(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.closing(writer), contextlib.suppress(asyncio.CancelledError):
            while not writer.is_closing():
                now = time.monotonic()
                writer.write(_report(_fix(now, road.host_m(now), HOST_M_S)))
                await asyncio.sleep(1 / FIXES_HZ)

    return serve


def _report(fix: Position) -> bytes:
    report = {
        "class": "TPV",
        "mode": 3,
        "time": datetime.now(UTC).isoformat().replace("+00:00", "Z"),
        "lat": fix.latitude_deg,
        "lon": fix.longitude_deg,
        "epx": 3.0,
        "epy": 3.0,
        "speed": fix.speed_m_s,
        "track": 0.0,
    }
    return json.dumps(report, separators=(",", ":")).encode() + b"\n"


def _delays_ms(trace: Sequence[Record], warned_at: Sequence[float]) -> Iterator[float]:
    """Time from the sending of each warning to the alarm that it raised."""
    alarms = [alarm_stamp_s(each) for each in trace if each["kind"] == "warning"]
    for at in warned_at:
        raised = [alarm for alarm in alarms if at <= alarm < at + 0.9 * PERIOD_S]
        if raised:
            yield (raised[0] - at) * 1e3


def free_port() -> int:
    """A free UDP port; the daemon binds it shortly after."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def processor_s(pid: int) -> float:
    """Processor time of a daemon and of its camera's process (proc(5))."""
    tasks = Path(f"/proc/{pid}/task").iterdir()
    children = " ".join((task / "children").read_text("ascii") for task in tasks).split()
    return sum(_own_processor_s(each) for each in (pid, *map(int, children)))


def _own_processor_s(pid: int) -> float:
    """Processor time of one process, from the fields of proc(5) behind the name."""
    fields = Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _dropped_by_kernel(port: int) -> int:
    """Datagrams for which the receive buffer had no space: last column of /proc/net/udp."""
    for line in Path("/proc/net/udp").read_text("ascii").splitlines()[1:]:
        fields = line.split()
        if int(fields[1].rpartition(":")[2], 16) == port:
            return int(fields[-1])
    return 0
