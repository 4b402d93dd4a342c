"""How well motion alone tells who is ahead in the row, on recorded platoons.

Each vehicle of three recorded platoons compares the last 80 s of its speed with those of all
others, through speedometers with steps of 1 km/h and errors of half a percent. Those of its own
platoon are ahead or behind, and those of the other two elsewhere, each at another time of its
drive. The recordings (`RIG_DATA` names their folder) are not part of the repository.
"""

import math
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from bench import Figure
from onboard.kinematics.units import KM_H
from onboard.risk.braking_ahead import AHEAD, IN_STREAM
from onboard.risk.stream_motion import LAGS, SAMPLE_S, WINDOW, StreamMotion
from sim_rig.roads.cars import Array
from sim_rig.roads.recording import STEP_S
from sim_rig.roads.trace_files import read_trace

FOLDER = Path(__file__).parents[2] / "shared" / "data" / "platoons"
EVERY_S, ALIKE_M_S = 30.0, 0.5
SAMPLES = WINDOW + LAGS
KINDS = ("ahead", "behind", "elsewhere")


def measure() -> Iterator[Figure]:
    """Yield the share of each kind that is taken for a vehicle ahead.

    Raises:
        SystemExit: there are no recordings.
    """
    folder = Path(os.environ.get("RIG_DATA", FOLDER.parent)) / "platoons"
    files = sorted(folder.glob("acc-*.csv"))
    if not files:
        raise SystemExit(f"no platoons at {folder} (RIG_DATA names the folder above it)")
    platoons = [[drive.speed_m_s for drive in read_trace(path).drives] for path in files]
    needed = math.log(AHEAD / (1.0 - AHEAD)) - math.log(IN_STREAM / (1.0 - IN_STREAM))
    found = [
        (kind, ratio >= needed, is_alike)
        for number in range(len(platoons))
        for kind, ratio, is_alike in _compared(platoons, number, np.random.default_rng(number))
    ]
    for kind in KINDS:
        shares = np.mean([result for each, *result in found if each == kind], axis=0).tolist()
        of = sum(each == kind for each, *_ in found)
        reference = f"mean speeds that differ by less than {ALIKE_M_S:g} m/s"
        yield Figure(f"stream_motion.{kind}", shares[0], "share", of, reference, shares[1])


def _compared(
    platoons: Sequence[Sequence[Array]], number: int, rng: np.random.Generator
) -> Iterator[tuple[str, float, bool]]:
    """Yield for each vehicle what another one is to it, the evidence, and if means are alike."""
    platoon, step = platoons[number], round(SAMPLE_S / STEP_S)
    elsewhere = [
        each for other in range(len(platoons)) if other != number for each in platoons[other]
    ]
    for end in range(SAMPLES * step, len(platoon[0]), round(EVERY_S / STEP_S)):
        drives = [each[:end] for each in platoon]
        drives += [each[: rng.integers(SAMPLES * step, len(each))] for each in elsewhere]
        shown = [_shown(each[::-1][: SAMPLES * step : step][::-1], rng) for each in drives]
        for host in range(len(platoon)):
            motion = StreamMotion()
            for sample in range(SAMPLES):
                others = {str(car): float(each[sample]) for car, each in enumerate(shown)}
                motion.receive_speeds(float(shown[host][sample]), others, sample * SAMPLE_S)
            for car in range(len(shown)):
                if car != host:
                    kind = 2 if car >= len(platoon) else int(car > host)
                    apart_m_s = float(np.mean(shown[host] - shown[car]))
                    yield KINDS[kind], motion.log_ratio(str(car)), abs(apart_m_s) < ALIKE_M_S


def _shown(speeds_m_s: Array, rng: np.random.Generator) -> Array:
    """What OBD says of true speeds."""
    result: Array = np.round(rng.normal(1.006, 0.005) * speeds_m_s / KM_H) * KM_H
    return result
