"""Joerer et al., section V: figures 5 to 11 and Table III, from the rig's own simulated approaches.

All values except those at beacons come from exact states. P_C is the integral of eq. 4, and a crash
is contact of two rectangles. Each figure is a PNG with its data as CSV; `table3.csv` and
`outcomes.csv` contain the paper's values as well.
"""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from onboard.settings import Settings
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.study import Case, Results, Study
from sim_rig.studies.joerer.criticality import (
    BEHAVIOURS,
    Beacons,
    car_size,
    criticality,
    highest,
    last_before_unavoidable,
    received,
)
from sim_rig.studies.joerer.figures import draw_bins, draw_boxes, draw_eccdf, draw_evolution
from sim_rig.studies.joerer.merging import YCrossing, merging
from sim_rig.studies.joerer.radio import BeaconSettings
from sim_rig.studies.joerer.traffic import (
    Approaches,
    ApproachOutcome,
    Array,
    TrafficSettings,
    simulate_approaches,
)

PAPER_OUTCOMES_PERCENT = {
    ApproachOutcome.CRASH: 3.76,
    ApproachOutcome.NEAR_CRASH: 0.84,
    ApproachOutcome.NO_CRASH: 95.4,
}
PAPER_TABLE_3_PERCENT = {
    "uniform": {1.0: (21.0, 25.0), 0.5: (45.0, 48.0), 0.1: (83.0, 87.0), 0.04: (93.0, 95.0)},
    "triangular": {1.0: (39.0, 49.0), 0.5: (69.0, 76.0), 0.1: (94.0, 96.5), 0.04: (98.5, 99.3)},
}
"""By behaviour and beacon interval in s, at 99 % and 95 % success."""

BIN_M = 2.0
BINS = 35
"""Figures 7 and 9 end at 70 m."""
BINNED_INTERVAL_S = 0.04
SLOWEST_INTERVAL_S = 1.0
"""Beacon interval of figure 8."""


class JoererSettings(Settings):
    """One run of the study."""

    seed: int = Field(1, ge=0)
    """Of all draws."""
    traffic: TrafficSettings = TrafficSettings()
    """The two cars that approach."""
    radio: BeaconSettings = BeaconSettings()
    """Which beacons are received."""
    merging_angle_deg: float = Field(30.0, ge=5.0, le=85.0)
    """Of the Y crossing."""
    merged_m: float = Field(15.0, gt=0.0)
    """How far beyond the junction of the Y crossing contacts count."""


@dataclass(frozen=True, slots=True)
class ApproachResults:
    """Data of all figures."""

    approaches: Approaches
    p_c: dict[str, Array]
    """(n, ticks) by behaviour, from exact data."""
    beacons: dict[float, Beacons]
    """By beacon interval in s."""

    @property
    def outcome_of_car(self) -> NDArray[np.int64]:
        """Outcomes (2 n,) of both cars of each approach."""
        return np.repeat(self.approaches.outcome, 2)

    def lbu(self, behaviour: str, interval_s: float) -> Array:
        """P_C at the last beacon before unavoidable (LBU) of each crashed car; NaN without one."""
        values = last_before_unavoidable(self.p_c[behaviour], self.beacons[interval_s])
        crashed: Array = values[self.outcome_of_car == ApproachOutcome.CRASH]
        return crashed


def simulate(settings: JoererSettings) -> ApproachResults:
    """Simulate approaches and beacons, and evaluate P_C in every recorded tick."""
    rng = np.random.default_rng(settings.seed)
    approaches = simulate_approaches(settings.traffic, rng)
    beacons = {
        interval_s: received(approaches, interval_s, settings.radio, rng)
        for interval_s in settings.radio.intervals_s
    }
    p_c = {name: criticality(approaches, name, settings.traffic) for name in BEHAVIOURS}
    return ApproachResults(approaches, p_c, beacons)


def write_files(
    out_dir: Path, results: Results[JoererSettings, ApproachResults, None], _workers: Workers
) -> None:
    """Write all tables and figures."""
    (found,) = results.rows
    _outcomes(found, out_dir)
    _figures_5_6_8(found, out_dir)
    _figures_7_9(found, out_dir)
    _figure_10(found, out_dir)
    _table_3(found, out_dir)
    _merging(found.approaches, results.settings, out_dir)


def summary(results: Results[JoererSettings, ApproachResults, None]) -> str:
    """The number of each outcome."""
    outcome = results.rows[0].approaches.outcome
    counts = np.bincount(outcome, minlength=len(ApproachOutcome))
    return ", ".join(f"{group.name} {counts[group]}" for group in ApproachOutcome)


def _outcomes(results: ApproachResults, out_dir: Path) -> None:
    percent = {
        group: 100.0 * np.mean(results.approaches.outcome == group) for group in ApproachOutcome
    }
    rows = [
        (group.name, round(percent[group], 2), PAPER_OUTCOMES_PERCENT[group])
        for group in ApproachOutcome
    ]
    _write(out_dir / "outcomes.csv", ("outcome", "ours_percent", "paper_percent"), rows)


def _figures_5_6_8(results: ApproachResults, out_dir: Path) -> None:
    of_car = results.outcome_of_car
    exact = {name: np.repeat(np.nanmax(p_c, axis=1), 2) for name, p_c in results.p_c.items()}
    slowest = results.beacons[SLOWEST_INTERVAL_S]
    by_interval = {
        f"{interval_s:g} s": highest(results.p_c["uniform"], beacons)
        for interval_s, beacons in sorted(results.beacons.items())
    }
    triangular = {"triangular, 1 s": highest(results.p_c["triangular"], slowest)}
    for number, panels in ((5, exact), (6, by_interval), (8, triangular)):
        draw_boxes(panels, of_car, out_dir / f"figure{number}.png")
        rows = [
            (title, group.name, *_five_numbers(values[of_car == group]))
            for title, values in panels.items()
            for group in ApproachOutcome
        ]
        header = ("panel", "outcome", "cars", *_FIVE_NUMBERS)
        _write(out_dir / f"figure{number}.csv", header, rows)


_FIVE_NUMBERS = ("min", "q25", "median", "q75", "max", "at_100_percent")


def _five_numbers(values: Array) -> tuple[float, ...]:
    if not len(values):
        return (0,)
    quartiles = np.percentile(values, [0, 25, 50, 75, 100]).round(4)
    return (len(values), *quartiles.tolist(), round(float(np.mean(values >= 1.0 - 1e-9)), 4))


def _figures_7_9(results: ApproachResults, out_dir: Path) -> None:
    def binned(behaviour: str, group: ApproachOutcome, statistic: str) -> Array:
        return _bin(results, behaviour, group, statistic)

    mean = {group.name: binned("uniform", group, "mean") for group in ApproachOutcome}
    worst = {
        "CRASH, minimum, uniform": binned("uniform", ApproachOutcome.CRASH, "min"),
        "CRASH, minimum, triangular": binned("triangular", ApproachOutcome.CRASH, "min"),
        "NO CRASH, maximum, triangular": binned("triangular", ApproachOutcome.NO_CRASH, "max"),
    }
    for number, panels in ((7, mean), (9, worst)):
        draw_bins(panels, BIN_M, out_dir / f"figure{number}.png")
        rows = [
            (title, (i + 0.5) * BIN_M, (j + 0.5) * BIN_M, round(float(values[i, j]), 4))
            for title, values in panels.items()
            for i, j in zip(*np.nonzero(np.isfinite(values)), strict=True)
        ]
        header = ("panel", "receiver_m", "sender_m", "p_c")
        _write(out_dir / f"figure{number}.csv", header, rows)


def _bin(results: ApproachResults, behaviour: str, group: ApproachOutcome, statistic: str) -> Array:
    """(BINS, BINS) by distance of receiver and sender; NaN where no beacon was received."""
    beacons = results.beacons[BINNED_INTERVAL_S]
    approach, receiver = beacons.car // 2, beacons.car % 2
    bins = [
        np.floor(results.approaches.distance_m[approach, beacons.tick, car] / BIN_M).astype(
            np.int64
        )
        for car in (receiver, 1 - receiver)
    ]
    wanted = results.approaches.outcome[approach] == group
    for bin_of in bins:
        wanted &= (bin_of >= 0) & (bin_of < BINS)
    at = tuple(bin_of[wanted] for bin_of in bins)
    values = results.p_c[behaviour][approach, beacons.tick][wanted].astype(np.float64)
    if statistic == "mean":
        total, count = np.zeros((2, BINS, BINS))
        np.add.at(total, at, values)
        np.add.at(count, at, 1.0)
        result: Array = np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0)
        return result
    ufunc = np.fmin if statistic == "min" else np.fmax
    extreme = np.full((BINS, BINS), np.nan)
    ufunc.at(extreme, at, values)
    return extreme


def _figure_10(results: ApproachResults, out_dir: Path) -> None:
    """Draw a typical crash: the one with the median of the highest P_C received at 1 s."""
    approaches, p_c = results.approaches, results.p_c["uniform"]
    crashed = np.flatnonzero(approaches.outcome == ApproachOutcome.CRASH)
    if not len(crashed):
        return
    highest_p_c = highest(p_c, results.beacons[SLOWEST_INTERVAL_S])[2 * crashed]
    typical = crashed[np.argsort(highest_p_c)[len(highest_p_c) // 2]]

    def until_crash(ticks: NDArray[np.int64]) -> tuple[Array, Array]:
        return ticks * approaches.tick_s - approaches.end_s[typical], p_c[typical, ticks]

    steps = {
        interval_s: until_crash(beacons.tick[beacons.car == 2 * typical])
        for interval_s, beacons in results.beacons.items()
    }
    exact = until_crash(np.flatnonzero(np.isfinite(p_c[typical])))
    draw_evolution(exact, steps, out_dir / "figure10.png")
    rows = [
        (label, round(float(time_s), 3), round(float(value), 4))
        for label, series in (("exact", exact), *steps.items())
        for time_s, value in zip(*series, strict=True)
    ]
    _write(out_dir / "figure10.csv", ("beacon_interval_s", "time_to_crash_s", "p_c"), rows)


def _table_3(results: ApproachResults, out_dir: Path) -> None:
    lbu = {
        name: {interval_s: results.lbu(name, interval_s) for interval_s in results.beacons}
        for name in BEHAVIOURS
    }
    draw_eccdf(lbu, out_dir / "figure11.png")
    rows = []
    for name, of_interval in lbu.items():
        for interval_s, values in of_interval.items():
            finite = values[np.isfinite(values)]
            if len(finite):
                percentiles = (round(100 * float(np.percentile(finite, q)), 1) for q in (1, 5, 50))
                paper = PAPER_TABLE_3_PERCENT[name].get(interval_s, ("", ""))
                rows.append(
                    (name, interval_s, *percentiles, *paper, len(finite), len(values) - len(finite))
                )
    header = (
        "behaviour", "beacon_interval_s", "ours_99", "ours_95", "ours_median",
        "paper_99", "paper_95", "cars", "cars_without_lbu",
    )  # fmt: skip
    _write(out_dir / "table3.csv", header, rows)


def _merging(approaches: Approaches, settings: JoererSettings, out_dir: Path) -> None:
    """Write the highest P_C of the same approaches on merging paths, by outcome."""
    size = car_size(settings.traffic)
    angle_rad = np.deg2rad(settings.merging_angle_deg)
    zone = YCrossing(size, size, np.array(angle_rad), np.array(settings.merged_m))
    merged = merging(approaches, zone)
    highest_p_c = {
        name: np.nanmax(criticality(merged, name, settings.traffic, zone), axis=1)
        for name in BEHAVIOURS
    }
    rows = [
        (name, group.name, *_five_numbers(values[merged.outcome == group]))
        for name, values in highest_p_c.items()
        for group in (ApproachOutcome.CRASH, ApproachOutcome.NO_CRASH)
    ]
    header = ("behaviour", "outcome", "approaches", *_FIVE_NUMBERS)
    _write(out_dir / "merging.csv", header, rows)


def _write(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


STUDY = Study(
    name="joerer",
    sentence="How well the collision probability tells crashes from other approaches.",
    settings=JoererSettings,
    takes_settings=False,
    about_s=lambda _: 120.0,
    case=Case,
    run=lambda settings, _: simulate(settings),
    more=write_files,
    summary=summary,
)
