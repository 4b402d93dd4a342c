"""The black box: bytes a minute, replay speed, and the effect of recording on the loop.

The drive is the demonstration's, in virtual time. References: the size of the same records as bare
JSON lines, real time for the replay (by processor time), and a loop without a recorder for the
delay of the loop and the duration of a step.
"""

import asyncio
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bench import Figure
from onboard.observations import ImageBox as Pixels
from onboard.observations import Lead, LeadIdentity, Plate, PlateCandidate, Sensor, Speed
from onboard.recorder.black_box import BlackBox
from onboard.recorder.reader import RecordedDrive
from onboard.recorder.settings import RecorderSettings
from onboard.replay.initial_state import InitialState
from onboard.replay.recorded_stack import recorded_stack
from onboard.replay.replay import compare
from onboard.settings import parse_settings
from onboard.vehicle.config import CarConfig
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario

CAR = "red"
LOOP_S = 5.0
STEPS_HZ = 100.0
"""Rate of a loop with a speed, two plates and a lead in each step: several times that of a car."""


def measure() -> Iterator[Figure]:
    """Yield size and replay speed of a drive, then a loop with and without a recorder."""
    scenario = load_scenario("fig4")
    with tempfile.TemporaryDirectory() as folder:
        run_virtual(scenario, recordings_folder=Path(folder))
        yield from _size_and_replay(RecordedDrive([Path(folder) / CAR]))
    yield from _loop()


def _size_and_replay(drive: RecordedDrive) -> Iterator[Figure]:
    began_s = time.process_time()
    minutes = compare(drive).until_s / 60.0
    took_s = time.process_time() - began_s
    size = sum(path.stat().st_size for path in drive.files)
    bare = sum(len(entry.topic) + len(entry.data) for entry in drive.entries())
    yield Figure(
        "recorder.size",
        size / minutes / 2**20,
        "MiB/min",
        1,
        "the same as JSON lines",
        bare / minutes / 2**20,
    )
    yield Figure(
        "recorder.replay",
        60.0 * minutes / took_s,
        "s/s",
        1,
        "real time",
        1.0,
    )


def _loop() -> Iterator[Figure]:
    with tempfile.TemporaryDirectory() as folder:
        states: list[object] = []
        black_box = BlackBox(RecorderSettings(folder=Path(folder)), states.append)
        without = asyncio.run(_drive(None))
        recording = asyncio.run(_drive(black_box))
    for index, name in enumerate(("late", "step")):
        for percentile in (50, 99):
            yield Figure(
                f"recorder.{name}.p{percentile}",
                float(np.percentile(recording[index], percentile)) * 1e3,
                "ms",
                len(recording[index]),
                "without a recorder",
                float(np.percentile(without[index], percentile)) * 1e3,
            )


async def _drive(black_box: BlackBox | None) -> tuple[list[float], list[float]]:
    """Delay of the start of each step, and its duration, in s."""
    tree = {"car": {"plate": "AB123"}, "security": {"plate_digest": {"scrypt_log2_n": 6}}}
    config = parse_settings(tree, CarConfig, "bench")
    now = time.monotonic()
    initial_state = InitialState(
        config=config,
        sensors=frozenset({Sensor.SPEED, Sensor.CAMERA}),
        seed=np.random.SeedSequence(1),
        now=now,
        utc_s=time.time(),
    )
    stack = recorded_stack(black_box, initial_state)
    if black_box is not None:
        black_box.start()
    late_s, took_s = [], []
    begin_at = time.monotonic()
    for number in range(round(LOOP_S * STEPS_HZ)):
        due_at = begin_at + number / STEPS_HZ
        await asyncio.sleep(max(0.0, due_at - time.monotonic()))
        now = time.monotonic()
        late_s.append(now - due_at)
        plates = [
            Plate(now, Pixels(300.0, 170.0, 52.0, 11.0), text, 0.9, is_lead=text == "CD456")
            for text in ("CD456", "EF789")
        ]
        lead = Lead(
            now,
            LeadIdentity.KNOWN,
            "CD456",
            15.0,
            0.4,
            0.1,
            0.5,
            track_id=1,
            candidates=(PlateCandidate("CD456", 0.98),),
        )
        stack.step([Speed(now, 15.0, 0.28, "obd:7E8"), *plates, lead], now, time.time())
        took_s.append(time.monotonic() - now)
    if black_box is not None:
        black_box.close()
    return late_s, took_s
