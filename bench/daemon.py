"""What the daemons of the demonstration take: processor time and memory, while it runs.

The reference, in the same run: a process that reads the same pictures from the same camera at the
same rate, decodes them and does nothing more. That much any program with this camera takes.
"""

import asyncio
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median

import psutil

from bench import Figure
from sim_rig.runs.live import LiveTestbench
from sim_rig.scenario.schema import Scenario, load_scenario

READER = "reader"
SETTLED_S = 2.0
"""After so long everybody has all that it keeps."""
READ_AND_DECODE = """
import sys
from onboard.config import CarConfig
from onboard.settings import load_settings
from onboard.vision.camera import open_frames
from pathlib import Path
for frame in open_frames(load_settings(Path(sys.argv[1]), CarConfig).camera):
    pass
"""


def measure() -> Iterator[Figure]:
    """Share of one core, and resident memory; median over the four daemons."""
    used = asyncio.run(_run(load_scenario("fig4")))
    reader_share, reader_bytes = used.pop(READER)
    shares, sizes = zip(*used.values(), strict=True)
    beside = "a process that only decodes the pictures"
    yield Figure("daemon.cpu", median(shares), "cores", len(shares), beside, reader_share)
    yield Figure(
        "daemon.memory", median(sizes) / 2**20, "MiB", len(sizes), beside, reader_bytes / 2**20
    )


async def _run(scenario: Scenario) -> dict[str, tuple[float, int]]:
    """Cores used and bytes resident, of each daemon and of the reference."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        async with LiveTestbench(scenario, scenario.seed, folder) as desk:
            car = scenario.equipped[0]
            await desk.processes.start(READER, "-c", READ_AND_DECODE, str(folder / f"{car}.yaml"))
            running = asyncio.create_task(desk.run())
            await _until(SETTLED_S, desk, running)
            names = [*scenario.equipped, READER]
            processes = {name: psutil.Process(desk.processes.pid(name)) for name in names}
            began_at, before = time.monotonic(), _cpu_s(processes)
            await _until(scenario.duration_s, desk, running)
            took_s = time.monotonic() - began_at
            used = {
                name: ((cpu_s - before[name]) / took_s, processes[name].memory_info().rss)
                for name, cpu_s in _cpu_s(processes).items()
            }
            await running
    return used


async def _until(at_s: float, desk: LiveTestbench, running: asyncio.Task[None]) -> None:
    """Wait for a moment of the scenario, or for a run that fails."""
    while time.monotonic() < desk.start_s + at_s and not running.done():
        await asyncio.sleep(0.05)


def _cpu_s(processes: dict[str, psutil.Process]) -> dict[str, float]:
    times = {name: process.cpu_times() for name, process in processes.items()}
    return {name: spent.user + spent.system for name, spent in times.items()}
