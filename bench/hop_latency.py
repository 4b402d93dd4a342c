"""Latency of a warning over one hop, through real daemons on loopback: brake sample to alarm.

Three daemons on the rig's testbench, as in `sim-rig run`: CAN over TCP, camera over HTTP, radio
over UDP. The first car brakes once in 1.1 s, and the two behind are warned. The latency is measured
from the reception of the sample by the braking car's daemon to the alarm record of the warned
car's. In between the warning crosses two UDP connections, from car to radio unit and from radio
unit to car; the radio channel adds no delay. The reference is a bare UDP echo to another process
and back, measured throughout the run.
"""

import asyncio
import multiprocessing
import socket
import tempfile
import time
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from bench import Figure
from onboard.settings import parse_settings
from sim_rig.run_log.latency_ledger import alarm_stamp_s, braking_of
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.live import LiveTestbench
from sim_rig.scenario.schema import Scenario

BRAKINGS = 50
PERIOD_S = 1.1
FIRST_S = 4.0
"""Time at which the group has formed."""
ECHO_EVERY_S = 0.02
WSM_BYTES = 75


def measure() -> Iterator[Figure]:
    """Yield median and 99th percentile, each with that of the bare echo."""
    log, echoes_s = asyncio.run(_run())
    hops_s = [
        alarm_stamp_s(warning) - brake["stamp_s"]
        for car in ("red", "blue")
        for warning in log.of(car, "warning")
        if (brake := braking_of(log, warning)) is not None
    ]
    for name, percentile in (("p50", 50), ("p99", 99)):
        yield Figure(
            f"hop_latency.{name}",
            float(np.percentile(hops_s, percentile)) * 1e3,
            "ms",
            len(hops_s),
            f"bare UDP echo, {name} of {len(echoes_s)}",
            float(np.percentile(echoes_s, percentile)) * 1e3,
        )


async def _run() -> tuple[RunLog, list[float]]:
    context = multiprocessing.get_context("spawn")
    parent_end, child_end = context.Pipe()
    echo = context.Process(target=_echo, args=(child_end,), daemon=True)
    echo.start()
    scenario = parse_settings(_scenario(), Scenario, "hop_latency")
    with tempfile.TemporaryDirectory() as folder:
        async with LiveTestbench(scenario, seed=1, folder=Path(folder)) as testbench:
            port = await asyncio.to_thread(parent_end.recv)
            pinging = asyncio.create_task(asyncio.to_thread(_ping, port, scenario.duration_s))
            await testbench.run()
            echoes_s = await pinging
        echo.terminate()
        return testbench.log(), echoes_s


def _scenario() -> dict[str, object]:
    """Three model cars with AR tags in a row, 10 m apart; the first brakes and accelerates."""
    brake_at_s = [FIRST_S + PERIOD_S * number for number in range(BRAKINGS)]
    sawtooth = [((at_s, 15.0), (at_s + 0.5, 11.0), (at_s + 1.0, 15.0)) for at_s in brake_at_s]
    mean_m_s = 15.0 - 2.0 / PERIOD_S
    end_s = FIRST_S + PERIOD_S * BRAKINGS
    speeds = {
        "green": list(chain.from_iterable(sawtooth)),
        "red": [(FIRST_S, 15.0), (FIRST_S + 1.0, mean_m_s), (end_s, mean_m_s)],
    }
    return {
        "title": "A car brakes repeatedly, and the two cars behind it are warned.",
        "seed": 1,
        "duration_s": end_s,
        "radio": {"reach_m": 300.0, "delay_s": 0.0},
        "cars": {
            name: {
                "tag_id": number,
                "lane": 1,
                "start_m": -14.5 * number,
                "speed_m_s": speeds.get(name, speeds["red"]),
            }
            for number, name in enumerate(("green", "red", "blue"))
        },
        "expect": [],
    }


def _ping(port: int, duration_s: float) -> list[float]:
    """Round trip times of a datagram during the run."""
    delays_s = []
    end_at = time.monotonic() + duration_s
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.settimeout(1.0)
        wire.connect(("127.0.0.1", port))
        while (sent_at := time.monotonic()) < end_at:
            wire.send(bytes(WSM_BYTES))
            wire.recv(WSM_BYTES)
            delays_s.append(time.monotonic() - sent_at)
            time.sleep(ECHO_EVERY_S)
    return delays_s


def _echo(parent: "multiprocessing.connection.Connection") -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.bind(("127.0.0.1", 0))
        parent.send(wire.getsockname()[1])
        while True:
            data, sender = wire.recvfrom(WSM_BYTES)
            wire.sendto(data, sender)
