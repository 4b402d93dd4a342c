"""How soon motion alone names the lead, on recorded platoons.

All vehicles of three recorded platoons are on the air at once; each follower but the first of its
platoon looks at the one ahead of it for a minute, through speedometers with steps of 1 km/h and
errors of half a percent, and a closing speed with 0.25 m/s of correlated noise. The recordings
(`RIG_DATA` names their folder) are not part of the repository.
"""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from bench import Figure
from onboard.lcca.identification import BELIEF
from onboard.lcca.identity_posterior import vehicle_probabilities
from onboard.lcca.motion_match import MotionMatch
from sim_rig.roads.cars import Array
from sim_rig.roads.recording import STEP_S
from sim_rig.roads.trace_files import read_trace

FOLDER = Path(__file__).parents[2] / "shared" / "data" / "platoons"
LOOK_S = 60.0
LEVEL_S = 10.0
"""Time over which the reference compares mean speeds."""
OBD_STEP_M_S = 1 / 3.6
DRAWS = 4
"""Draws of the errors of speedometers and cameras."""


def measure() -> Iterator[Figure]:
    """Yield the share named rightly within a minute, the time it took, and the wrong names.

    Raises:
        SystemExit: there are no recordings.
    """
    folder = Path(os.environ.get("RIG_DATA", FOLDER.parent)) / "platoons"
    files = sorted(folder.glob("acc-*.csv"))
    if not files:
        raise SystemExit(f"no platoons at {folder} (RIG_DATA names the folder above it)")
    platoons = [[drive.speed_m_s for drive in read_trace(path).drives] for path in files]
    looks = [
        look
        for draw in range(DRAWS)
        for number in range(len(platoons))
        for look in _looks(platoons, number, np.random.default_rng([draw, number]))
    ]
    right_s = [at_s for is_right, at_s, _ in looks if is_right and at_s is not None]
    wrong = sum(at_s is not None and not is_right for is_right, at_s, _ in looks)
    by_level = sum(is_level_right for _, _, is_level_right in looks)
    of = len(looks)  # the pairs of vehicles are 21, whatever the draws
    reference = "the nearest mean speed of 10 s"
    yield Figure("motion_match.right", len(right_s) / of, "share", of, reference, by_level / of)
    yield Figure("motion_match.wrong", wrong / of, "share", of, reference, 1 - by_level / of)
    median_s = float(np.median(right_s)) if right_s else float("nan")
    yield Figure("motion_match.time", median_s, "s", len(right_s), reference, LEVEL_S)


def _looks(
    platoons: Sequence[Sequence[Array]], number: int, rng: np.random.Generator
) -> Iterator[tuple[bool, float | None, bool]]:
    """Yield for each look: whether the name is right, when it came, and the reference's result."""
    everybody = [speeds for platoon in platoons for speeds in platoon]
    first = sum(len(platoon) for platoon in platoons[:number])
    steps = round(LOOK_S / STEP_S)
    for start in range(0, len(platoons[number][0]) - steps, steps):
        for follower in range(1, len(platoons[number])):
            ahead = first + follower - 1
            windows = {
                car: np.resize(speeds[start:] if car >= first else speeds, steps)
                for car, speeds in enumerate(everybody)
                if car != first + follower
            }
            own = platoons[number][follower][start : start + steps]
            yield _look(windows, ahead, own, rng)


def _look(
    windows: dict[int, Array], ahead: int, own_m_s: Array, rng: np.random.Generator
) -> tuple[bool, float | None, bool]:
    match = MotionMatch()
    scales = {car: float(rng.normal(1.006, 0.005)) for car in windows}
    error_m_s, named = 0.0, None
    sums_m_s = dict.fromkeys(windows, 0.0)
    for step, own in enumerate(own_m_s):
        now = step * STEP_S
        error_m_s = 0.82 * error_m_s + 0.57 * float(rng.normal(0.0, 0.25))
        seen_m_s = float(windows[ahead][step]) + error_m_s
        for car, speeds in windows.items():
            shown_m_s = round(scales[car] * speeds[step] / OBD_STEP_M_S) * OBD_STEP_M_S
            match.receive_speed_on_air(bytes([car]), shown_m_s, now)
            sums_m_s[car] += (shown_m_s - seen_m_s) * (now < LEVEL_S)
        match.receive_lead_speed(seen_m_s, 0.25, float(own), now)
        if named is None and step % 5 == 0:
            probabilities = vehicle_probabilities(
                [], {}, match.log_ratios(), in_row=match.in_row_log_ratios()
            )
            name, probability = max(probabilities.items(), key=lambda item: item[1])
            if probability >= BELIEF:
                named = name, now
    is_level_right = min(sums_m_s, key=lambda car: abs(sums_m_s[car])) == ahead
    if named is None:
        return False, None, is_level_right
    return named[0] == bytes([ahead]), named[1], is_level_right
