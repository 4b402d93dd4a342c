"""Latency of a warning over one hop, through real daemons on loopback: brake sample to alarm.

Three daemons on the rig's testbench, as in `sim-rig run`: CAN over TCP, camera over HTTP, radio
over UDP. The first car brakes once in 1.1 s, and the two behind are warned. The latency is measured
from the reception of the sample by the braking car's daemon to the alarm record of the warned
car's. In between the warning crosses two UDP connections, from car to radio unit and from radio
unit to car; the radio channel adds no delay.

Then one daemon alone, stage by stage from socket to alarm, with and without the camera's process
(`_hop_stages.py`). The reference is a bare UDP echo to another process and back, measured
throughout each run.
"""

import asyncio
import tempfile
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from bench import Figure
from bench._hop_stages import measure_hops
from bench._udp_echo import udp_echoes
from onboard.settings import parse_settings
from sim_rig.run_log.latency_ledger import alarm_stamp_s, braking_of
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.live import LiveTestbench
from sim_rig.scenario.schema import Scenario

BRAKINGS = 50
PERIOD_S = 1.1
FIRST_S = 4.0
"""Time at which the group has formed."""


def measure() -> Iterator[Figure]:
    """Yield median and 99th percentile of the chain and of its stages."""
    log, echoes_s = asyncio.run(_run())
    hops_s = [
        alarm_stamp_s(warning) - brake["stamp_s"]
        for car in ("red", "blue")
        for warning in log.of(car, "warning")
        if (brake := braking_of(log, warning)) is not None
    ]
    yield from _figures("hop_latency", hops_s, echoes_s)
    for with_camera, name in ((True, "camera"), (False, "no_camera")):
        hops = measure_hops(2 * BRAKINGS, with_camera=with_camera)
        for stage, durations_s in hops.durations_s.items():
            yield from _figures(f"hop_latency.{name}.{stage}", durations_s, hops.echoes_s)


def _figures(name: str, delays_s: list[float], echoes_s: list[float]) -> Iterator[Figure]:
    for rank, percentile in (("p50", 50), ("p99", 99)):
        yield Figure(
            f"{name}.{rank}",
            float(np.percentile(delays_s, percentile)) * 1e3,
            "ms",
            len(delays_s),
            f"bare UDP echo, {rank} of {len(echoes_s)}",
            float(np.percentile(echoes_s, percentile)) * 1e3,
        )


async def _run() -> tuple[RunLog, list[float]]:
    scenario = parse_settings(_scenario(), Scenario, "hop_latency")
    with tempfile.TemporaryDirectory() as folder:
        async with (
            LiveTestbench(scenario, seed=1, folder=Path(folder)) as testbench,
            udp_echoes() as echoes_s,
        ):
            await testbench.run()
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
