"""Processor time and memory of the daemons of the demonstration.

The reference, in the same run, is a process that reads the same images from the same camera at the
same rate and only decodes them, which is the minimum for any program with this camera.
"""

import asyncio
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median

import psutil

from bench import Figure
from bench._processor import used
from sim_rig.runs.live import LiveTestbench
from sim_rig.scenario.schema import Scenario, load_scenario

READER = "reader"
SETTLED_S = 2.0
"""Time after which the memory of all daemons is constant."""
READ_AND_DECODE = """
import sys
from onboard.vehicle.config import CarConfig
from onboard.settings import load_settings
from onboard.vision.camera import open_frames
from pathlib import Path
for frame in open_frames(load_settings(Path(sys.argv[1]), CarConfig).camera):
    pass
"""


def measure() -> Iterator[Figure]:
    """Yield the share of one core and the resident memory, medians of the four daemons."""
    figures = asyncio.run(_run(load_scenario("fig4")))
    reader_share, reader_bytes = figures.pop(READER)
    shares, sizes = zip(*figures.values(), strict=True)
    reference = "a process that only decodes the images"
    yield Figure("daemon.cpu", median(shares), "cores", len(shares), reference, reader_share)
    yield Figure(
        "daemon.memory", median(sizes) / 2**20, "MiB", len(sizes), reference, reader_bytes / 2**20
    )


async def _run(scenario: Scenario) -> dict[str, tuple[float, int]]:
    """Processor cores and resident bytes, of each daemon with its camera, and of the reference."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        async with LiveTestbench(scenario, scenario.seed, folder) as testbench:
            car = scenario.equipped[0]
            await testbench.processes.start(
                READER, "-c", READ_AND_DECODE, str(folder / f"{car}.yaml")
            )
            running = asyncio.create_task(testbench.run())
            await _until(SETTLED_S, testbench, running)
            names = [*scenario.equipped, READER]
            processes = {name: psutil.Process(testbench.processes.pid(name)) for name in names}
            began_at = time.monotonic()
            before = {name: used(process) for name, process in processes.items()}
            await _until(scenario.duration_s, testbench, running)
            took_s = time.monotonic() - began_at
            after = {name: used(process) for name, process in processes.items()}
            await running
    return {
        name: ((now.all_cpu_s - before[name].all_cpu_s) / took_s, now.resident_bytes)
        for name, now in after.items()
    }


async def _until(at_s: float, testbench: LiveTestbench, running: asyncio.Task[None]) -> None:
    """Wait for a time of the scenario, or until the run fails."""
    while time.monotonic() < testbench.start_s + at_s and not running.done():
        await asyncio.sleep(0.05)
