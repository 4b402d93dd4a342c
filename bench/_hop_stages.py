"""Where the time of one hop goes, stage by stage, in a daemon that drives.

The daemon follows a car that this process plays: its cores, signed messages over UDP, its plate in
the images of a camera. That car brakes again and again. Each warning is noted when it is sent, and
when the daemon passes each stage. From the alarm to the page measures `bench pages`.
"""

import asyncio
import json
import socket
import tempfile
import time
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import yaml

from bench._scene import CAMERA_FPS, SPEED_M_S, LoopCamera, free_port, port_of
from bench._traced_daemon import LEAD_PLATE
from bench._udp_echo import udp_echoes
from onboard.observations import HardBrake, Speed
from onboard.security.credentials import Credentials
from onboard.security.key_files import write_credentials
from onboard.settings import parse_settings
from onboard.step import Input, ReceivedWsm
from onboard.tools.test_ca.authority import KnownPlate, make_trial
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from onboard.wave_udp import psid
from sim_rig.cars.camera_view import LENS
from sim_rig.cars.ecu import Ecu
from sim_rig.cars.socketcand_server import SocketcandServer
from sim_rig.processes.processes import Processes
from sim_rig.scenario.car_config import DIGEST, plate_digest

STAGES = ("wake_up", "queue", "verify", "decode", "group", "sign", "send", "show")
"""From the sending by the lead to the daemon's loop, to the step, to the verified signature,
to the decoded message, to the decision of the group, to the signed acknowledgement, to its sending,
and, when the step is recorded, to the alarm in trace, metrics and views of the page."""
_PASSED = (
    "left",
    "taken",
    "begun",
    "verified",
    "decoded",
    "grouped",
    "signed",
    "sent",
    "shown",
)
SETTLE_S = 5.0
BRAKE_EVERY_S = 0.4


@dataclass(frozen=True, slots=True)
class Hops:
    """Durations in s, one of each warning."""

    durations_s: dict[str, list[float]]
    """By stage; `total` is the sum of all."""
    echoes_s: list[float]
    """Round trips of the reference."""


def measure_hops(brakings: int, *, with_camera: bool) -> Hops:
    """Let a daemon be warned `brakings` times, with or without perception beside its loop."""
    with tempfile.TemporaryDirectory() as name:
        return asyncio.run(_run(Path(name), brakings, with_camera=with_camera))


async def _run(folder: Path, brakings: int, *, with_camera: bool) -> Hops:
    digest = plate_digest()
    plates = {"own": KnownPlate("OWN1", digest), "ahead": KnownPlate(LEAD_PLATE, digest)}
    trial = make_trial(plates, {psid.BSM, psid.LCCA}, time.time(), plates=plates)
    write_credentials(folder / "keys", trial["own"])
    ecu = SocketcandServer(Ecu(lambda _now: SPEED_M_S), "can0", lambda _frame: None)
    camera = await asyncio.start_server(LoopCamera(LEAD_PLATE).serve, "127.0.0.1", 0)
    ahead = _LeadVehicle(trial["ahead"])
    config = {
        "car": {"plate": "OWN1"},
        "can": {"channel": "can0", "port": await ecu.start()},
        "camera": LENS.model_dump() | {"source": f"http://127.0.0.1:{port_of(camera)}/"},
        "vision": {"tag_dictionary": None},
        "radio": {"endpoint": "iwcu", "listen_port": ahead.daemon_port, "unit_port": ahead.port},
        "security": {
            "keys_folder": str(folder / "keys"),
            "plate_digest": DIGEST,
            "check_braking": False,  # constant speed
        },
        "recorder": {"folder": str(folder / "box")},
        "hmi": {"port": free_port()},
        "trace": {"file": str(folder / "trace.jsonl")},
    }
    (folder / "car.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    no_camera = () if with_camera else ("--no-camera",)
    out = folder / "stages.jsonl"
    async with Processes(folder) as processes:
        arguments = (*no_camera, str(folder / "car.yaml"), str(out))
        await processes.start("car", "-m", "bench._traced_daemon", *arguments)
        driving = asyncio.create_task(ahead.drive())
        await processes.sleep_until(time.monotonic() + SETTLE_S)
        async with udp_echoes() as echoes_s:
            for _ in range(brakings):
                for is_over in (False, True):
                    ahead.brake(is_over=is_over)
                    await processes.sleep_until(time.monotonic() + BRAKE_EVERY_S / 2)
        driving.cancel()
    camera.close()
    await ecu.close()
    await asyncio.sleep(2 / CAMERA_FPS)  # the camera's connection ends
    rows = [json.loads(line) for line in out.read_text(encoding="utf-8").splitlines()]
    return Hops(_durations_s(rows, ahead.left_s), echoes_s)


def _durations_s(
    rows: Iterable[dict[str, float]], left_s: dict[int, float]
) -> dict[str, list[float]]:
    durations_s: dict[str, list[float]] = {name: [] for name in (*STAGES, "total")}
    for row in rows:
        row["left"] = left_s.get(int(row["checksum"]), np.nan)
        steps_s = [after - before for before, after in pairwise(row[name] for name in _PASSED)]
        if not min(steps_s) >= 0.0:
            continue  # another message came in between
        for name, step_s in zip(STAGES, steps_s, strict=True):
            durations_s[name].append(step_s)
        durations_s["total"].append(row["shown"] - row["left"])
    return durations_s


class _LeadVehicle:
    """The cores of the lead, and its radio."""

    def __init__(self, credentials: Credentials) -> None:
        self._radio = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._radio.bind(("127.0.0.1", 0))
        self._radio.setblocking(False)
        self.port = self._radio.getsockname()[1]
        self.daemon_port = free_port()
        tree = {"car": {"plate": LEAD_PLATE}, "security": {"plate_digest": DIGEST}}
        config = parse_settings(tree, CarConfig, "bench")
        self._stack = Stack(
            config,
            (),
            np.random.default_rng(1),
            now=time.monotonic(),
            utc_s=time.time(),
            credentials=credentials,
        )
        self.left_s: dict[int, float] = {}
        """When each frame was given to its socket, by its checksum."""

    async def drive(self) -> None:
        """Drive at constant speed, and answer all messages."""
        loop = asyncio.get_running_loop()
        loop.add_reader(self._radio, self._receive)
        try:
            while True:
                self._step([Speed(time.monotonic(), SPEED_M_S, 0.1, "bench")])
                await asyncio.sleep(0.05)
        finally:
            loop.remove_reader(self._radio)
            self._radio.close()

    def brake(self, *, is_over: bool) -> None:
        """Warn, or tell that the braking is over."""
        self._step([HardBrake(time.monotonic(), 6.0, "bench", is_over=is_over)])

    def _receive(self) -> None:
        self._step([ReceivedWsm(time.monotonic(), self._radio.recv(4096))])

    def _step(self, inputs: list[Input]) -> None:
        for wsm in self._stack.step(inputs, time.monotonic(), time.time()).wsms:
            self.left_s[zlib.crc32(wsm.data)] = time.monotonic()
            self._radio.sendto(wsm.data, ("127.0.0.1", self.daemon_port))
