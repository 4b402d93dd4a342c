"""One daemon under load: 15 images a second, OBD, GNSS, ten signed remote vehicles; and its start.

The camera shows a car with a plate, the ECU is polled twenty times a second, gpsd reports ten fixes
a second, and ten remote vehicles send BSMs ten times a second, each with a footer of its
detections. All messages are signed and verified. The reference for time and memory is a process
that only decodes the same images; for start and stop it is Python that imports NumPy and OpenCV.
"""

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import psutil
import yaml

from bench import Figure
from bench._processor import used
from bench._scene import SPEED_M_S, LoopCamera, free_port, port_of
from bench.daemon import READ_AND_DECODE
from onboard.observations import Position, Speed, VehicleDetection
from onboard.security.credentials import Credentials
from onboard.security.key_files import write_credentials
from onboard.settings import parse_settings
from onboard.step import Input
from onboard.tools.test_ca.authority import make_trial
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from onboard.wave_udp import psid
from sim_rig.cars.camera_view import LENS
from sim_rig.cars.ecu import Ecu
from sim_rig.cars.socketcand_server import SocketcandServer
from sim_rig.processes.processes import Processes

REMOTE_VEHICLES = 10
SETTLE_S, MEASURE_S = 4.0, 20.0
STARTS = 3
LATITUDE_DEG, LONGITUDE_DEG, M_PER_DEG = 52.0, 5.0, 111_000.0
FIXES_HZ = 10.0


def measure() -> Iterator[Figure]:
    """Yield processor cores by function and memory, and durations of start, reload and stop."""
    with tempfile.TemporaryDirectory() as name:
        (cores, size), (reader_cores, reader_size) = asyncio.run(_work(Path(name)))
        reference = "a process that only decodes the images"
        reader = sum(reader_cores.values())
        for function, share in {"cpu": sum(cores.values()), **cores}.items():
            yield Figure(f"at_work.{function}", share, "cores", 1, reference, reader)
        yield Figure("at_work.memory", size / 2**20, "MiB", 1, reference, reader_size / 2**20)
        durations = [_start_reload_stop_s(Path(name)) for _ in range(STARTS)]
        python_only = [_python_s() for _ in range(STARTS)]
        reference = "Python that imports NumPy and OpenCV and ends"
        for what, times in zip(
            ("start_to_ready", "reload", "stop"), zip(*durations, strict=True), strict=True
        ):
            figure = (
                float(np.median(times)),
                "s",
                STARTS,
                reference,
                float(np.median(python_only)),
            )
            yield Figure(f"at_work.{what}", *figure)


async def _work(folder: Path) -> tuple[tuple[dict[str, float], int], ...]:
    """Processor cores by function and bytes, of the daemon and of the reference."""
    trial = make_trial(
        ["own", *(f"car{number}" for number in range(REMOTE_VEHICLES))],
        {psid.BSM, psid.LCCA},
        time.time(),
    )
    write_credentials(folder / "keys", trial.pop("own"))
    ecu = SocketcandServer(Ecu(lambda _now: SPEED_M_S), "can0", lambda _frame: None)
    camera = await asyncio.start_server(LoopCamera("AB123CD").serve, "127.0.0.1", 0)
    gpsd = await asyncio.start_server(_serve_fixes, "127.0.0.1", 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unit:
        unit.bind(("127.0.0.1", 0))
        port = free_port()
        config = {
            "car": {"plate": "OWN1"},
            "can": {"channel": "can0", "port": await ecu.start()},
            "camera": LENS.model_dump() | {"source": f"http://127.0.0.1:{port_of(camera)}/"},
            "vision": {"tag_dictionary": None},
            "gnss": {"port": port_of(gpsd)},
            "radio": {
                "endpoint": "iwcu",
                "listen_port": port,
                "unit_port": unit.getsockname()[1],
            },
            "security": {"keys_folder": str(folder / "keys")},
        }
        (folder / "car.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
        async with Processes(folder) as processes:
            await processes.start("car", "-m", "onboard", "run", str(folder / "car.yaml"))
            await processes.start("reader", "-c", READ_AND_DECODE, str(folder / "car.yaml"))
            traffic = asyncio.create_task(_traffic(list(trial.values()), unit, port))
            running = [psutil.Process(processes.pid(name)) for name in ("car", "reader")]
            await processes.sleep_until(time.monotonic() + SETTLE_S)
            before = [used(process) for process in running]
            await processes.sleep_until(time.monotonic() + MEASURE_S)
            after = [used(process) for process in running]
            traffic.cancel()
    await ecu.close()
    camera.close()
    gpsd.close()
    return tuple(
        (now.cores_since(then, MEASURE_S), now.resident_bytes)
        for now, then in zip(after, before, strict=True)
    )


async def _traffic(credentials: list[Credentials], unit: socket.socket, port: int) -> None:
    """Ten remote vehicles in two lanes behind the host vehicle, each with two detections."""
    now, utc_s = time.monotonic(), time.time()
    config = parse_settings({"car": {"plate": "OTHER1"}}, CarConfig, "bench")
    others = [
        Stack(config, (), np.random.default_rng(number), now=now, utc_s=utc_s, credentials=own)
        for number, own in enumerate(credentials)
    ]
    began_s = now
    while True:
        now = time.monotonic()
        ahead_m = (now - began_s) * SPEED_M_S
        for number, other in enumerate(others):
            behind_m, beside_m = 15.0 * (number // 2 + 1), 3.5 * (number % 2)
            detections = (
                VehicleDetection(now, track, 15.0 * track, 0.5, 0.0, 0.02) for track in (1, 2)
            )
            inputs: tuple[Input, ...] = (
                Speed(now, SPEED_M_S, 0.1, "bench"),
                _position(now, ahead_m - behind_m, beside_m),
                *detections,
            )
            for wsm in other.step(inputs, now, time.time()).wsms:
                unit.sendto(wsm.data, ("127.0.0.1", port))
            await asyncio.sleep(0)
        await asyncio.sleep(max(0.0, now + 0.1 - time.monotonic()))


def _position(now: float, north_m: float, east_m: float) -> Position:
    return Position(
        stamp_s=now,
        latitude_deg=LATITUDE_DEG + north_m / M_PER_DEG,
        longitude_deg=LONGITUDE_DEG + east_m / M_PER_DEG / np.cos(np.radians(LATITUDE_DEG)),
        altitude_m=0.0,
        sigma_m=1.5,
        speed_m_s=SPEED_M_S,
        course_rad=0.0,
    )


async def _serve_fixes(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Serve fixes as gpsd does."""
    began_s = time.monotonic()
    while not writer.is_closing():
        north_m = (time.monotonic() - began_s) * SPEED_M_S
        report = {
            "class": "TPV",
            "mode": 3,
            "time": datetime.now(UTC).isoformat().replace("+00:00", "Z"),
            "lat": LATITUDE_DEG + north_m / M_PER_DEG,
            "lon": LONGITUDE_DEG,
            "epx": 3.0,
            "epy": 3.0,
            "speed": SPEED_M_S,
            "track": 0.0,
        }
        writer.write(json.dumps(report, separators=(",", ":")).encode() + b"\n")
        await asyncio.sleep(1 / FIXES_HZ)


def _start_reload_stop_s(folder: Path) -> tuple[float, float, float]:
    """Seconds from start to ready, from SIGHUP to ready, and from SIGTERM to the end."""
    address = folder / "notify"
    address.unlink(missing_ok=True)
    config = folder / "start.yaml"
    tree = {
        "car": {"plate": "OWN1"},
        "radio": {"endpoint": "iwcu", "listen_port": free_port(), "unit_port": 9},
        "security": {"keys_folder": str(folder / "keys")},
        "trace": {"file": str(folder / "trace.jsonl")},
    }
    config.write_text(yaml.safe_dump(tree), encoding="utf-8")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(address))

        def until_ready(since_s: float) -> float:
            while not manager.recv(4096).startswith(b"READY=1"):
                pass
            return time.monotonic() - since_s

        began_s = time.monotonic()
        process = subprocess.Popen(
            [sys.executable, "-m", "onboard", "run", str(config)],
            env=os.environ | {"NOTIFY_SOCKET": str(address)},
            stderr=subprocess.DEVNULL,
        )
        start_s = until_ready(began_s)
        time.sleep(1.0)  # signal it while it is running
        signalled_s = time.monotonic()
        process.send_signal(signal.SIGHUP)
        reload_s = until_ready(signalled_s)
        time.sleep(1.0)
        signalled_s = time.monotonic()
        process.terminate()
        process.wait()
        return start_s, reload_s, time.monotonic() - signalled_s


def _python_s() -> float:
    began_s = time.monotonic()
    subprocess.run([sys.executable, "-c", "import numpy, cv2"], check=True)
    return time.monotonic() - began_s
