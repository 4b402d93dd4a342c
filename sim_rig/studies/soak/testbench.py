"""Many real daemons at the same time, all within radio range of each other, without cameras."""

import asyncio
import socket
import time
from contextlib import AsyncExitStack
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml

from onboard.security.key_files import write_credentials
from onboard.tools.test_ca.authority import KnownPlate, make_trial
from onboard.wave_udp import psid
from sim_rig.cars.ecu import Ecu
from sim_rig.cars.socketcand_server import SocketcandServer
from sim_rig.processes.processes import ProcessError, Processes
from sim_rig.scenario.car_config import DIGEST, plate_digest
from sim_rig.studies.soak.load import free_port, processor_s

READY_WITHIN_S = 120.0
SPEED_M_S = 15.0


@dataclass(frozen=True, slots=True)
class DaemonUsage:
    """Resources used by each daemon, and messages sent by it."""

    cores: list[float]
    memory_mib: list[float]
    sent_per_s: list[float]
    """Messages a second to the radio unit."""
    longest_gaps_s: list[float]
    """Longest time between two messages."""


async def run_daemons(folder: Path, cars: int, during_s: float) -> DaemonUsage:
    """Run daemons and measure them.

    Args:
        folder: of keys, configurations and traces.
        cars: number of daemons.
        during_s: duration of the measurement, after all are ready.

    Raises:
        ProcessError: a daemon is not ready in time, or has ended.
    """
    names, digest = [f"car{n}" for n in range(cars)], plate_digest()
    plates = {name: KnownPlate(name.upper(), digest) for name in names}
    trial = make_trial(names, {psid.BSM, psid.LCCA}, time.time(), plates=plates)
    async with AsyncExitStack() as wires:
        radio = _RadioUnits()
        wires.callback(radio.close)
        processes = await wires.enter_async_context(Processes(folder))
        for name, credentials in trial.items():
            write_credentials(folder / name, credentials)
            bus = SocketcandServer(Ecu(lambda _now: SPEED_M_S), "can0", lambda _frame: None)
            port = free_port()
            config = {
                "car": {"plate": name.upper()},
                "can": {"channel": "can0", "port": await bus.start()},
                "radio": {"endpoint": "iwcu", "listen_port": port, "unit_port": radio.add(port)},
                "security": {"keys_folder": str(folder / name), "plate_digest": DIGEST},
            }
            wires.push_async_callback(bus.close)
            file = folder / f"{name}.yaml"
            file.write_text(yaml.safe_dump(config), encoding="utf-8")
            await processes.start(name, "-m", "onboard", "run", str(file))
        give_up_at = time.monotonic() + READY_WITHIN_S
        while not all(unit.received_at for unit in radio.units):
            await processes.sleep_until(time.monotonic() + 0.1)
            if time.monotonic() > give_up_at:
                raise ProcessError(
                    f"not all of {cars} daemons are ready after {READY_WITHIN_S:g} s"
                )
        radio.clear()
        before_s = [processor_s(processes.pid(name)) for name in trial]
        await processes.sleep_until(time.monotonic() + during_s)
        used_s = [processor_s(processes.pid(name)) for name in trial]
        memory_mib = [_resident_mib(processes.pid(name)) for name in trial]
        return DaemonUsage(
            [(after - before) / during_s for before, after in zip(before_s, used_s, strict=True)],
            memory_mib,
            [len(unit.received_at) / during_s for unit in radio.units],
            [float(np.diff(unit.received_at).max()) for unit in radio.units],
        )


@dataclass(slots=True)
class _Unit:
    wire: socket.socket
    car_port: int
    received_at: list[float] = field(default_factory=list)


class _RadioUnits:
    """Radio units that relay every message to all others at once."""

    def __init__(self) -> None:
        self.units: list[_Unit] = []

    def add(self, car_port: int) -> int:
        """Open the radio unit of a daemon; returns the unit's port."""
        wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        wire.bind(("127.0.0.1", 0))
        wire.setblocking(False)
        unit = _Unit(wire, car_port)
        self.units.append(unit)
        asyncio.get_running_loop().add_reader(wire, self._relay, unit)
        return int(wire.getsockname()[1])

    def clear(self) -> None:
        """Begin to count."""
        for unit in self.units:
            unit.received_at.clear()

    def close(self) -> None:
        """Close all units."""
        for unit in self.units:
            asyncio.get_running_loop().remove_reader(unit.wire)
            unit.wire.close()

    def _relay(self, sender: _Unit) -> None:
        try:
            wsm = sender.wire.recv(8192)
        except OSError:
            return  # a message was sent to a daemon that is not ready yet
        sender.received_at.append(time.monotonic())
        for unit in self.units:
            if unit is not sender:
                unit.wire.sendto(wsm, ("127.0.0.1", unit.car_port))


def _resident_mib(pid: int) -> float:
    for line in Path(f"/proc/{pid}/status").read_text("ascii").splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    return float("nan")
