"""How many vehicles an eavesdropper follows across a change of all pseudonyms.

All vehicles of a scene change at once, and are silent for a while or not. The eavesdropper receives
the last BSM of each before and the first one after, and assigns the new pseudonyms to the old ones,
one to one: by motion (position, speed and time between both), or by the phase of transmission, the
only other content that could stay. Right by chance is one vehicle of the N that are there.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from pydantic import Field
from scipy.optimize import linear_sum_assignment

from onboard.bsm_transmission.schedule import JITTER_S, MINIMUM_INTERVAL_S
from onboard.kinematics.arrays import Array
from onboard.settings import Settings
from sim_rig.roads.cars import Cars
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.campaigns.intervals import wilson
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study
from sim_rig.studies.mvs.scenes import SceneName, SceneSource, open_scene

POSITION_SIGMA_M = 0.3
"""White part of the position error: the rest is the same before and after."""
SPEED_SIGMA_M_S = 0.1
ACCELERATION_M_S2 = 2.0
"""Sigma of what a driver does during the silence."""
YAW_RATE_RAD_S = 0.2
"""Sigma of how a driver turns during the silence."""


class LinkerKind(StrEnum):
    """By what pseudonyms are linked."""

    MOTION = "motion"
    KEPT_PHASE = "phase, if it were kept"
    PHASE = "phase"


class LinkerSettings(Settings):
    """One campaign; a run is one silence."""

    seed: int = Field(1, ge=0)
    """Of all draws, together with the number of the run."""
    scene: SceneSource = SceneName.CITY_TRACE
    """Whose traffic is followed: a scene of the MVS studies, or a file."""
    changes: int = Field(20, ge=1)
    """At times spread over the recording."""
    silences_s: Several[float] = (0.0, 1.0, 3.0, 10.0, 30.0)
    """For how long no vehicle sends after the change."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SilenceCase(Case):
    """All changes with one silence."""

    silence_s: float


def axes(settings: LinkerSettings) -> Axes:
    """Every silence."""
    return {"silence_s": settings.silences_s}


@dataclass(frozen=True, slots=True)
class LinkerLine:
    """One line of the table: what one kind of linker finds; the interval is of 95 %."""

    linker: LinkerKind
    silence_s: float
    changes: int
    vehicles: int
    """In all changes together."""
    linked: int
    share: float
    least: float
    most: float
    chance: float
    """The share that is right by chance."""


@dataclass(frozen=True, slots=True)
class SilenceRow:
    """All changes with one silence."""

    lines: list[LinkerLine]


def run(settings: LinkerSettings, case: SilenceCase) -> SilenceRow:
    """Link the vehicles of all changes with one silence."""
    silence_s = case.silence_s
    rng = np.random.default_rng((settings.seed, case.number))
    recording = open_scene(settings.scene).recording
    latest_s = recording.end_s - silence_s - 2.0 * MINIMUM_INTERVAL_S
    times_s = np.linspace(0.1 * latest_s, 0.9 * latest_s, settings.changes)
    linked = dict.fromkeys(LinkerKind, 0)
    vehicles, chance = 0, 0.0
    for at_s in times_s.tolist():
        there = recording.cars_at(at_s - MINIMUM_INTERVAL_S).names
        later = recording.cars_at(at_s + silence_s + MINIMUM_INTERVAL_S).names
        names = [name for name in there if name in set(later)]
        if not names:
            continue
        sent_s = at_s - rng.uniform(0.0, MINIMUM_INTERVAL_S, len(names))
        anew_s = at_s + silence_s + rng.uniform(0.0, MINIMUM_INTERVAL_S, len(names))
        before = _received(recording.cars_at(at_s - MINIMUM_INTERVAL_S), names, rng)
        before[:, :2] += (sent_s - at_s + MINIMUM_INTERVAL_S)[:, None] * before[:, 2:]
        after = _received(recording.cars_at(at_s + silence_s), names, rng)
        after[:, :2] += (anew_s - at_s - silence_s)[:, None] * after[:, 2:]
        messages = max(1, round(silence_s / MINIMUM_INTERVAL_S))
        jitter_s = rng.uniform(-JITTER_S, JITTER_S, (len(names), messages)).sum(axis=1)
        costs = {
            LinkerKind.MOTION: motion_cost(before, after, anew_s[None] - sent_s[:, None]),
            LinkerKind.KEPT_PHASE: phase_cost(sent_s, sent_s + jitter_s),
            LinkerKind.PHASE: phase_cost(sent_s, anew_s),
        }
        for kind, cost in costs.items():
            linked[kind] += count_linked(cost)
        vehicles += len(names)
        chance += 1.0
    lines = []
    for kind in LinkerKind:
        _, least, most = wilson(linked[kind] / max(vehicles, 1), max(vehicles, 1))
        lines.append(
            LinkerLine(
                linker=kind,
                silence_s=silence_s,
                changes=settings.changes,
                vehicles=vehicles,
                linked=linked[kind],
                share=linked[kind] / max(vehicles, 1),
                least=least,
                most=most,
                chance=chance / max(vehicles, 1),
            )
        )
    return SilenceRow(lines)


def motion_cost(before: Array, after: Array, elapsed_s: Array) -> Array:
    """Return how unlikely it is that each old pseudonym became each new one.

    Args:
        before: (N, 4) position and velocity, east and north, in m and m/s.
        after: (M, 4).
        elapsed_s: (N, M) from the one BSM to the other.

    Returns:
        (N, M) squared distance in sigmas, plus the logarithm of the covariance's determinant.
    """
    speed_m_s = np.hypot(before[:, 2], before[:, 3])
    ahead = before[:, 2:] / np.maximum(speed_m_s, 0.1)[:, None]
    predicted_m = before[:, None, :2] + elapsed_s[..., None] * before[:, None, 2:]
    off_m = after[None, :, :2] - predicted_m
    along_m = np.einsum("nmk,nk->nm", off_m, ahead)
    across_m = off_m[..., 1] * ahead[:, None, 0] - off_m[..., 0] * ahead[:, None, 1]
    drift_m = ACCELERATION_M_S2 * elapsed_s**2 / 2.0
    turned_m = speed_m_s[:, None] * YAW_RATE_RAD_S * elapsed_s**2 / 2.0
    sigma_along_m = np.hypot(2.0 * POSITION_SIGMA_M, drift_m)
    sigma_across_m = np.hypot(2.0 * POSITION_SIGMA_M, turned_m)
    sigma_m_s = np.hypot(2.0 * SPEED_SIGMA_M_S, ACCELERATION_M_S2 * elapsed_s)
    faster_m_s = np.hypot(after[:, 2], after[:, 3])[None] - speed_m_s[:, None]
    cost: Array = (
        (along_m / sigma_along_m) ** 2
        + (across_m / sigma_across_m) ** 2
        + (faster_m_s / sigma_m_s) ** 2
        + 2.0 * np.log(sigma_along_m * sigma_across_m * sigma_m_s)
    )
    return cost


def phase_cost(sent_s: Array, anew_s: Array) -> Array:
    """Return by how much the phases of the old and the new transmissions differ, (N, M) in s."""
    apart_s = anew_s[None] - sent_s[:, None]
    cost: Array = np.abs(
        (apart_s + MINIMUM_INTERVAL_S / 2.0) % MINIMUM_INTERVAL_S - MINIMUM_INTERVAL_S / 2.0
    )
    return cost


def count_linked(cost: Array) -> int:
    """Return how many of N vehicles the cheapest assignment gives their own new pseudonym.

    Args:
        cost: (N, N); the vehicles are in the same order before and after.
    """
    rows, columns = linear_sum_assignment(cost)
    return int(np.count_nonzero(rows == columns))


def _received(cars: Cars, names: list[str], rng: np.random.Generator) -> Array:
    """Return position and velocity as the BSMs report them, (N, 4)."""
    index = {name: at for at, name in enumerate(cars.names)}
    rows = [index[name] for name in names]
    position_m = cars.middle_m[rows] + rng.normal(0.0, POSITION_SIGMA_M, (len(rows), 2))
    velocity_m_s = cars.velocity_m_s[rows] + rng.normal(0.0, SPEED_SIGMA_M_S, (len(rows), 2))
    return np.hstack([position_m, velocity_m_s])


def table(_settings: LinkerSettings, rows: Sequence[SilenceRow]) -> list[LinkerLine]:
    """A line for each silence and kind of linker."""
    return [line for row in rows for line in row.lines]


def summary(results: Results[LinkerSettings, SilenceRow, LinkerLine]) -> str:
    """The shares linked by motion."""
    return "; ".join(
        f"{line.silence_s:.0f} s: {line.share:.0%} by motion"
        for line in results.table
        if line.linker is LinkerKind.MOTION
    )


STUDY = Study(
    name="linker",
    sentence="How many vehicles an eavesdropper follows across a change of all pseudonyms.",
    settings=LinkerSettings,
    axes=axes,
    case=SilenceCase,
    run=run,
    row=SilenceRow,
    table=table,
    line=LinkerLine,
    summary=summary,
)
