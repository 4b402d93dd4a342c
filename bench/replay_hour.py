"""An hour's recording with signed messages: how fast it replays, and in how much memory.

Two cars of the demonstration drive in virtual time, which takes some minutes. The recording of the
one behind is replayed and compared by a process of its own. References: real time, by processor
time, and the memory for the first tenth of the recording.
"""

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from bench import Figure
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario

HOUR_S = 3600.0
CARS = ("green", "red")


class _Replay(NamedTuple):
    processor_s: float
    memory_mib: float


def measure(duration_s: float = HOUR_S) -> Iterator[Figure]:
    """Yield the speed of a replay, and its memory."""
    scenario = load_scenario("fig4")
    two = {name: scenario.cars[name] for name in CARS}
    drive = scenario.model_copy(
        update={"cars": two, "duration_s": duration_s, "signed": True, "expect": ()}
    )
    with tempfile.TemporaryDirectory() as folder:
        run_virtual(drive, recordings_folder=Path(folder))
        segments = sorted((Path(folder) / CARS[-1]).glob("*.mcap"))
        part = _replay(segments[: max(1, len(segments) // 10)])
        whole = _replay(segments)
    speed = duration_s / whole.processor_s
    yield Figure("replay_hour.speed", speed, "s/s", 1, "real time", 1.0)
    memory = whole.memory_mib
    yield Figure("replay_hour.memory", memory, "MiB", 1, "its first tenth", part.memory_mib)


def _replay(segments: Sequence[Path]) -> _Replay:
    command = [sys.executable, "-c", _PROGRAM, "replay", *map(str, segments), "--expect"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    processor_s, memory_kib = re.findall(r"^(?:used|VmHWM):\s*([0-9.]+)", done.stderr, re.MULTILINE)
    return _Replay(float(processor_s), float(memory_kib) / 1024.0)


_PROGRAM = """
import sys, time
from pathlib import Path
from onboard.tools.cli import main
try:
    main()
finally:
    sys.stderr.write(f"used: {time.process_time()}\\n")
    sys.stderr.write(Path("/proc/self/status").read_text())
"""
"""`onboard`, which tells what it used: `ru_maxrss` would include the memory of its parent."""
