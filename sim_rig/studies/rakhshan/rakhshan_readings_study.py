"""Readings of what Rakhshan et al. leave open, changed together.

A reading is a point of a Sobol sequence over all that the paper does not say. Even numbers have the
paper's slot, the duration of a packet (D = tau R / L); odd ones a longer slot. Each reading gives
the best equal access probability and the reduction by driver-based access, which the paper states
as 0.05 and 25 %.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from matplotlib.figure import Figure
from pydantic import Field, field_validator
from scipy.stats import qmc

from onboard.settings import Settings
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.campaigns.campaign import StoredRow, Workers
from sim_rig.studies.campaigns.results import write_settings, write_table
from sim_rig.studies.campaigns.study import Case, Results, Study, columns
from sim_rig.studies.rakhshan.best_access import PAPERS_OPTIMUM, RakhshanSettings, gain, simulate
from sim_rig.studies.rakhshan.chain import Relay
from sim_rig.studies.rakhshan.highway import Labels, RakhshanHighwaySettings, Spacing

PAPERS_REDUCTION = 0.25

RANGES = {
    "mean_gap_m": (8.0, 50.0),
    "path_loss_exponent": (2.0, 5.0),
    "reaction_factor": (0.4, 1.6),
    "unsafe_threshold": (0.05, 0.95),
    "slots_per_packet": (1.0, 400.0),
}
"""Even on a logarithmic scale, except for the threshold."""

CHOICES: dict[str, tuple[object, ...]] = {
    "spacing": tuple(Spacing),
    "synchronous": (True, False),
    "random_waits": (False, True),
    "relay": tuple(Relay),
    "labels": tuple(Labels),
    "first_car": ("as the others", "safe", "unsafe"),
    "iteration_s": (*[None] * 7, 0.5),
    "common_deceleration": (False, True),
    "one_lane_brakes": (False, True),
    "pile_ups": (False, True),
}
"""Equally likely; labels are renewed in an eighth of the readings, which take longer."""


class ReadingsSettings(Settings):
    """One campaign; a run is one reading."""

    seed: int = Field(1, ge=0)
    """Of the sequence of readings, and of the highways of each."""
    runs: int = Field(512, ge=2)
    """Number of readings; every other one has longer slots than the paper's."""
    drops: int = Field(100, ge=4)
    """Highways of a reading; one half selects the best probabilities, the other evaluates them."""
    repeated: int = Field(3, ge=0)
    """The readings with the largest reduction, of each kind of slot, are repeated."""
    repeated_drops: int = Field(400, ge=4)
    """Other highways than before, once more with random labels."""
    access: Several[float] = (0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.15, 0.3)
    """Access probabilities, in all pairs for safe and unsafe cars; one is the paper's optimum."""
    highway: RakhshanHighwaySettings = RakhshanHighwaySettings()
    """What the paper states."""

    @field_validator("access")
    @classmethod
    def _contains_the_papers(cls, access: tuple[float, ...]) -> tuple[float, ...]:
        if PAPERS_OPTIMUM not in access:
            raise ValueError(f"{PAPERS_OPTIMUM:g} must be one of them")
        return access


def reading(settings: ReadingsSettings, number: int) -> RakhshanHighwaySettings:
    """The highway of a reading; each number has its own, whatever the number of runs."""
    sequence = qmc.Sobol(len(RANGES) + len(CHOICES), rng=settings.seed)
    if number:
        sequence.fast_forward(number)
    shares = iter(sequence.random(1)[0].tolist())
    changes: dict[str, object] = {}
    for name, (low, high) in RANGES.items():
        share = next(shares)
        even = name == "unsafe_threshold"
        changes[name] = low + share * (high - low) if even else low * (high / low) ** share
    for name, choices in CHOICES.items():
        changes[name] = choices[int(next(shares) * len(choices))]
    if number % 2 == 0:
        changes["slots_per_packet"] = 1.0
    return settings.highway.model_copy(update=changes)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingRow:
    """One reading; all but the access probabilities are shares of the cars that collide."""

    unsafe_share: float
    """Of the cars, not of collisions."""
    without_radio: float
    least_with_equal_access: float
    at_papers_optimum: Annotated[float, Field(alias=f"at_{PAPERS_OPTIMUM:g}")]
    equal_access: float
    """The best equal probability."""
    safe_access: float
    """Of the best pair."""
    unsafe_access: float
    reduction: float
    """By the best pair, compared with the best equal probability."""
    error_95: float
    perfect_radio: float
    """The reduction by a radio without delay."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatedRow(ReadingRow):
    """One reading with other highways."""

    reduction_at_random: float
    """With random labels, as a control."""
    error_95_at_random: float


ReadingLine = dict[str, object]
"""One line of the table: the reading's number, what the paper leaves open, and the row."""
ReadingResults = Results[ReadingsSettings, ReadingRow, ReadingLine]


def run(settings: ReadingsSettings, case: Case) -> ReadingRow:
    """Simulate one reading."""
    return ReadingRow(**_gain(settings, case.number, settings.drops, shuffled=False))


def repeat(settings: ReadingsSettings, case: Case) -> RepeatedRow:
    """Simulate one reading with other highways, and with random labels."""
    other = settings.model_copy(update={"seed": settings.seed + 1})
    highway, drops = reading(settings, case.number), settings.repeated_drops
    labelled, random = (
        _gain(other, case.number, drops, shuffled=shuffled, highway=highway)
        for shuffled in (False, True)
    )
    return RepeatedRow(
        **labelled,
        reduction_at_random=random["reduction"],
        error_95_at_random=random["error_95"],
    )


def _gain(
    settings: ReadingsSettings,
    number: int,
    drops: int,
    *,
    shuffled: bool,
    highway: RakhshanHighwaySettings | None = None,
) -> dict[str, float]:
    """The values of a row."""
    study = RakhshanSettings(
        seed=int(np.random.SeedSequence([settings.seed, number]).generate_state(1)[0]),
        drops=drops,
        access=settings.access,
        highway=highway or reading(settings, number),
    )
    outcome = simulate(study, shuffled=shuffled)
    found = gain(study, outcome)
    equal = outcome.equal.mean(axis=-1)
    return {
        "unsafe_share": outcome.unsafe_share,
        "without_radio": float(outcome.without_radio.mean()),
        "least_with_equal_access": float(equal.min()),
        "at_papers_optimum": float(equal[settings.access.index(PAPERS_OPTIMUM)]),
        "equal_access": found.equal_access,
        "safe_access": found.safe_access,
        "unsafe_access": found.unsafe_access,
        "reduction": found.reduction,
        "error_95": found.error,
        "perfect_radio": found.perfect_radio,
    }


def table(settings: ReadingsSettings, rows: Sequence[ReadingRow]) -> list[ReadingLine]:
    """A line for each reading."""
    return [_line(settings, number, STUDY.stored(row)) for number, row in enumerate(rows)]


def _line(settings: ReadingsSettings, number: int, row: StoredRow) -> ReadingLine:
    highway = reading(settings, number).model_dump(mode="json")
    return {"reading": number, **{name: highway[name] for name in (*RANGES, *CHOICES)}, **row}


def write_repeated(out_dir: Path, results: ReadingResults, workers: Workers) -> None:
    """Repeat the readings with the largest reduction, and write them into their own folder."""
    settings, rows = results.settings, results.rows
    best = [
        number
        for slots in (0, 1)
        for number in sorted(
            range(slots, len(rows), 2), key=lambda number: -rows[number].reduction
        )[: settings.repeated]
    ]
    repeated = REPEATED.rows(settings, out_dir, workers, best)
    lines = [
        _line(settings, number, REPEATED.stored(row))
        for number, row in zip(best, repeated, strict=True)
    ]
    header = columns(dict, lines or results.table)
    write_table(out_dir / "repeated", header, [list(line.values()) for line in lines])
    write_settings(out_dir / "repeated", settings)


def has_papers_optimum(row: ReadingRow) -> bool:
    """Whether the best equal probability is the paper's."""
    return row.equal_access == PAPERS_OPTIMUM


def has_papers_reduction(row: ReadingRow) -> bool:
    """Whether the interval of the reduction reaches the paper's, by a pair as the paper's.

    Its unsafe cars send more than p_0, its safe cars less.
    """
    return (
        row.reduction + row.error_95 >= PAPERS_REDUCTION
        and row.safe_access < row.equal_access < row.unsafe_access
    )


def _agreement(rows: Sequence[ReadingRow]) -> str:
    def count(agrees: Callable[[ReadingRow], bool]) -> int:
        return sum(agrees(row) for row in rows)

    both = count(lambda row: has_papers_optimum(row) and has_papers_reduction(row))
    most = max((row.reduction for row in rows), default=math.nan)
    return (
        f"of {len(rows)} readings {count(has_papers_optimum)} have their optimum at"
        f" {PAPERS_OPTIMUM:g}, {count(has_papers_reduction)} a reduction of"
        f" {PAPERS_REDUCTION:.0%}, {both} both; the largest reduction is {most:.1%}"
    )


def picture(results: ReadingResults) -> Figure:
    """Draw the reduction of each reading over its best equal access probability."""
    rows = results.rows
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    rng = np.random.default_rng(0)
    for name, some in (("slots of a packet", rows[::2]), ("longer slots", rows[1::2])):
        # Many readings share an optimum, so the points are spread sideways.
        access = [row.equal_access * math.exp(rng.uniform(-0.12, 0.12)) for row in some]
        axes.plot(access, [100 * row.reduction for row in some], ".", ms=4, label=name)
    axes.plot(PAPERS_OPTIMUM, 100 * PAPERS_REDUCTION, "k*", ms=12, label="paper")
    axes.set(xscale="log", xlabel="best equal channel access probability")
    axes.set_ylabel("fewer collisions by driver-based access, %")
    axes.legend(frameon=False)
    return figure


def summary(results: ReadingResults) -> str:
    """How many readings agree with the paper."""
    return "; ".join(
        f"{name}: {_agreement(rows)}"
        for name, rows in (
            ("slots of a packet", results.rows[::2]),
            ("longer slots", results.rows[1::2]),
        )
    )


STUDY = Study(
    name="rakhshan-readings",
    sentence="Which readings of what the paper leaves open give its optimum and its reduction.",
    settings=ReadingsSettings,
    repeat=lambda settings: settings.runs,
    case=Case,
    run=run,
    row=ReadingRow,
    table=table,
    line=ReadingLine,
    picture=picture,
    more=write_repeated,
    summary=summary,
)
REPEATED = replace(
    STUDY,
    name="rakhshan-readings, repeated",
    run=repeat,
    row=RepeatedRow,
    folder=lambda _: "repeated",
)
