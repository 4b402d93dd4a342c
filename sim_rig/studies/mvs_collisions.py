"""The MVS paper's Fig. 9 and Fig. 3: probability that an event ends in a crash, by share of radios.

One run is one event of one seed under one case. Event, drivers and the order in which cars get a
radio depend on the seed alone, so cases are compared run by run.
"""

import math
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from pydantic import Field

from onboard.settings import Settings
from sim_rig.roads.events import TrafficEventKind
from sim_rig.scenario.setting_types import Several, Share
from sim_rig.studies.campaign import Row, Workers, run_campaign
from sim_rig.studies.mvs_encounter import EncounterCase, Encounters, EncounterSettings, Method
from sim_rig.studies.mvs_outcomes import CrashOutcome
from sim_rig.studies.mvs_scenes import SceneName, SceneSource, available_scene
from sim_rig.studies.mvs_world import FooterSize
from sim_rig.studies.results import write_results

PAPER_REDUCTION: dict[SceneSource, float] = {
    SceneName.CROSSING: 0.615,
    SceneName.SUMO_CROSSING: 0.615,
    SceneName.CITY: 0.601,
}
"""Reduction of the collision probability by MVS at 40 %: all that the paper prints of Fig. 9."""
_MOST_COMPARED = 0.4
_Z_95 = 1.96


class CollisionSettings(Settings):
    """One campaign."""

    seed: int = Field(1, ge=0)
    runs: int = Field(500, ge=1)
    """Events of each kind."""
    kinds: Several[TrafficEventKind] = tuple(TrafficEventKind)
    shares: Several[Share] = (0.1, 0.2, 0.3, 0.4, 0.6, 0.8)
    methods: Several[Method] = (Method.DSRC, Method.OWN, Method.MVS)
    """At every share."""
    compared_at: float | None = Field(default=_MOST_COMPARED, gt=0.0, le=1.0)
    """Share at which also MO, RS, other footer sizes and a loss of half of all messages are run."""
    entries: tuple[FooterSize, ...] = (5, 20)
    """M, where it is not 10."""
    unaffected_every: int = Field(1, ge=1, le=100)
    """Events in which radios cannot avoid anything (no crash, or no car that can act has a radio)
    are run with radios only once in so many, with that weight: they show what warnings cause."""
    encounter: EncounterSettings = EncounterSettings()


class Figure3Settings(CollisionSettings):
    """Fig. 3: red-light runners and plain DSRC."""

    runs: int = Field(1000, ge=1)
    kinds: Several[TrafficEventKind] = (TrafficEventKind.RED_LIGHT,)
    shares: Several[Share] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
    methods: Several[Method] = (Method.DSRC,)
    compared_at: float | None = None


def cases(settings: CollisionSettings) -> list[EncounterCase]:
    """All cases of one seed, each once however often the settings name it."""
    shape = []
    for kind in settings.kinds:
        shape.append(EncounterCase(kind, Method.NONE, 0.0))
        shape += [
            EncounterCase(kind, m, share) for share in settings.shares for m in settings.methods
        ]
        share = settings.compared_at
        if share is not None:
            shape += [
                EncounterCase(kind, m, share) for m in (Method.MEASUREMENTS_ONLY, Method.RANDOM)
            ]
            shape += [
                EncounterCase(kind, Method.MVS, share, entries) for entries in settings.entries
            ]
            shape += [EncounterCase(kind, m, share, loss=0.5) for m in (Method.DSRC, Method.MVS)]
    return list(dict.fromkeys(shape))


@cache
def encounters(settings: EncounterSettings) -> Encounters:
    """The simulator of these settings, created once in a process."""
    return Encounters(settings)


def case_of(settings: CollisionSettings, number: int) -> tuple[EncounterCase, int]:
    """Case and seed of a run; all cases of a seed have consecutive numbers."""
    of_a_seed = cases(settings)
    return of_a_seed[number % len(of_a_seed)], settings.seed + number // len(of_a_seed)


def run_one(settings: CollisionSettings, number: int) -> Row:
    """One run of the campaign."""
    case, seed = case_of(settings, number)
    scene = encounters(settings.encounter)
    row: Row = {
        "kind": case.kind.value,
        "method": case.method.value,
        "share": case.share,
        "entries": case.entries,
        "loss": case.loss,
        "seed": seed,
        "weight": 1,
    }
    if settings.unaffected_every > 1 and case.method is not Method.NONE:
        before, is_unaffected = scene.without_radios(case, seed)
        if is_unaffected and seed % settings.unaffected_every:
            result = CrashOutcome.NO_RADIO.value if before is not None else None
            return row | {"weight": 0, "crash": before is not None, "outcome": result}
        row["weight"] = settings.unaffected_every if is_unaffected else 1
    outcome = scene.run(case, seed)
    return row | {
        "crash": outcome.crash is not None,
        "speed_m_s": outcome.crash.speed_m_s if outcome.crash else None,
        "outcome": outcome.crash_outcome.value if outcome.crash_outcome else None,
        "known_before_s": outcome.known_before_s,
        "warned_before_s": outcome.warned_before_s,
        "first_warning_s": outcome.first_warning_s,
        "warned": outcome.warned,
        "false_warnings": outcome.false_warnings,
        "paper_alarm_crash": outcome.paper_alarm_crash is not None,
        "paper_alarm_same_pair": outcome.paper_alarm_same_pair,
        "paper_alarm_before_s": outcome.paper_alarm_before_s,
        "paper_alarm_false": outcome.paper_alarm_false,
        "driven_s": outcome.driven_s,
        "messages": outcome.messages,
    }


def figure9(
    out_dir: Path, settings: CollisionSettings | None = None, workers: Workers | None = None
) -> str:
    """Write collision probabilities by method and share, and what the paper does not report.

    Args:
        out_dir: folder of table, figure, settings and runs.
        settings: of the campaign; the default ones if None.
        workers: processes or cluster; this process if None.

    Returns:
        The reduction of crashes by MVS, as a sentence.
    """
    settings = _with_available_scene(settings or CollisionSettings())
    rows = _all_runs(out_dir, settings, workers)
    table = _table(settings, rows)
    write_results(out_dir, _Line._fields, table, settings, _draw(settings, table))
    return _summary(settings, rows, _MOST_COMPARED)


def figure3(
    out_dir: Path, settings: CollisionSettings | None = None, workers: Workers | None = None
) -> str:
    """Write the collision probability of red-light runners with plain DSRC.

    Args:
        out_dir: folder of table, figure, settings and runs.
        settings: of the campaign; the default ones if None.
        workers: processes or cluster; this process if None.

    Returns:
        The collision probabilities without radios and at the largest share, as a sentence.
    """
    settings = _with_available_scene(settings or Figure3Settings())
    rows = _all_runs(out_dir, settings, workers)
    table = _table(settings, rows)
    write_results(out_dir, _Line._fields, table, settings, _draw(settings, table))
    first, last = table[0], table[-1]
    return (
        f"P(collision) {first.p_collision:.2f} without radios,"
        f" {last.p_collision:.2f} at a share of {last.share_with_radio:g}"
    )


def _with_available_scene(settings: CollisionSettings) -> CollisionSettings:
    scene = available_scene(settings.encounter.scene)
    encounter = settings.encounter.model_copy(update={"scene": scene})
    return settings.model_copy(update={"encounter": encounter})


def _all_runs(out_dir: Path, settings: CollisionSettings, workers: Workers | None) -> list[Row]:
    numbers = range(len(cases(settings)) * settings.runs)
    return run_campaign(run_one, settings, numbers, out_dir / "runs", workers or Workers())


class _Line(NamedTuple):
    """One line of the table: a case and its results."""

    kind: str
    method: str
    share_with_radio: float
    M: int
    loss: float
    runs: int
    p_collision: float
    low_95: float
    high_95: float
    reduction: float
    avoided: int
    caused: int
    warning_after_s: float
    false_warnings_per_h: float
    known_before_s: float
    warned_before_s: float
    paper_alarm_p_collision: float
    paper_alarm_avoided: int
    paper_alarm_before_s: float
    paper_alarm_false_per_h: float
    outcome_no_radio: int
    outcome_unknown: int
    outcome_unwarned: int
    outcome_too_late: int
    outcome_another: int
    outcome_avoided: int
    two_cars_p_collision: float
    two_cars_reduction: float
    paper_alarm_two_cars_reduction: float


_Key = tuple[str, str, float, int, float]


def _key(row: Row) -> _Key:
    return row["kind"], row["method"], row["share"], row["entries"], row["loss"]


def _table(settings: CollisionSettings, rows: Sequence[Row]) -> list[_Line]:
    """A line for each case, for each kind and for both kinds together."""
    both = (
        [row | {"kind": "both", "event": row["kind"]} for row in rows]
        if len(settings.kinds) > 1
        else []
    )
    by_case: dict[_Key, list[Row]] = {}
    for row in [*both, *rows]:
        by_case.setdefault(_key(row), []).append(row)
    return [_line(key, mine, by_case) for key, mine in by_case.items()]


def _line(key: _Key, mine: list[Row], by_case: dict[_Key, list[Row]]) -> _Line:
    kind, method, share, entries, loss = key
    none = by_case[kind, Method.NONE.value, 0.0, 10, 0.0]
    p_none = float(np.mean([row["crash"] for row in none]))
    avoided, caused = changed(none, mine)
    p, low, high = wilson(p_none - (avoided - caused) / len(mine), len(mine))
    run = [row for row in mine if "driven_s" in row]
    hours = sum(row["weight"] * row["driven_s"] for row in run) / 3600.0
    false_warnings, paper_alarm_false = (
        sum(row["weight"] * row[column] for row in run)
        for column in ("false_warnings", "paper_alarm_false")
    )
    paper_alarm_avoids = [row for row in run if row["outcome"] and not row["paper_alarm_crash"]]
    pair_crashes_avoided = _count_pair_crashes_avoided(mine)
    paper_alarm_no_pair_crash = sum(
        bool(row["outcome"]) and not row["paper_alarm_same_pair"] for row in run
    )
    crashes = p_none * len(mine)
    return _Line(
        kind=kind,
        method=method,
        share_with_radio=share,
        M=entries,
        loss=loss,
        runs=len(mine),
        p_collision=p,
        low_95=low,
        high_95=high,
        reduction=1.0 - p / p_none if p_none else math.nan,
        avoided=avoided,
        caused=caused,
        warning_after_s=_median(run, "first_warning_s"),
        false_warnings_per_h=false_warnings / hours if hours else math.nan,
        known_before_s=_median(run, "known_before_s"),
        warned_before_s=_median(run, "warned_before_s"),
        paper_alarm_p_collision=p_none - len(paper_alarm_avoids) / len(mine),
        paper_alarm_avoided=len(paper_alarm_avoids),
        paper_alarm_before_s=_median(run, "paper_alarm_before_s"),
        paper_alarm_false_per_h=paper_alarm_false / hours if hours else math.nan,
        **{
            f"outcome_{outcome.value}": sum(row["outcome"] == outcome for row in mine)
            for outcome in CrashOutcome
        },
        two_cars_p_collision=p_none - pair_crashes_avoided / len(mine),
        two_cars_reduction=pair_crashes_avoided / crashes if crashes else math.nan,
        paper_alarm_two_cars_reduction=paper_alarm_no_pair_crash / crashes if crashes else math.nan,
    )


def _count_pair_crashes_avoided(rows: Iterable[Row]) -> int:
    """Crashes avoided as the paper counts: these two cars do not crash, others may."""
    return sum(row["outcome"] in {CrashOutcome.AVOIDED, CrashOutcome.ANOTHER} for row in rows)


def _median(rows: Sequence[Row], column: str) -> float:
    values = [row[column] for row in rows if row[column] is not None]
    return float(np.median(values)) if values else math.nan


def changed(before: Iterable[Row], after: Iterable[Row]) -> tuple[int, int]:
    """Crashes that only `before` has, and those that only `after` has, compared seed by seed."""

    def event(row: Row) -> tuple[str, int]:
        return str(row.get("event", row["kind"])), int(row["seed"])

    crashed = {event(row): row["crash"] for row in before}
    pairs = [(crashed[event(row)], row["crash"], row["weight"]) for row in after]
    avoided = sum(weight for a, b, weight in pairs if a and not b)
    return avoided, sum(weight for a, b, weight in pairs if b and not a)


def wilson(p: float, n: int) -> tuple[float, float, float]:
    """A share `p` of n, limited to 0 to 1, and Wilson's 95 % interval of its probability."""
    p = min(max(p, 0.0), 1.0)
    middle = (p + _Z_95**2 / (2 * n)) / (1 + _Z_95**2 / n)
    half = _Z_95 * math.sqrt(p * (1 - p) / n + _Z_95**2 / (4 * n * n)) / (1 + _Z_95**2 / n)
    return p, middle - half, middle + half


def _summary(settings: CollisionSettings, rows: Sequence[Row], share: float) -> str:
    def at(method: Method) -> list[Row]:
        return [
            row
            for row in rows
            if (row["method"], row["entries"], row["loss"]) == (method.value, 10, 0.0)
            and (row["share"] == share or method is Method.NONE)
        ]

    none, mvs, own = at(Method.NONE), at(Method.MVS), at(Method.OWN)
    if not mvs:
        return f"{len(rows)} runs"
    before = sum(row["crash"] for row in none)
    if not before:
        return f"no event ends in a crash without radios ({len(none)} events)"
    fewer, more = changed(none, mvs)
    paper = PAPER_REDUCTION.get(settings.encounter.scene)
    text = f"at {share:.0%} MVS reduces crashes by {(fewer - more) / before:.1%}"
    text += f", of the two cars alone {_count_pair_crashes_avoided(mvs) / before:.1%}"
    if paper is not None:
        text += f" (paper: {paper:.1%})"
    avoided = {(r["kind"], r["seed"]) for r in none if r["crash"]}
    avoided -= {(r["kind"], r["seed"]) for r in mvs if r["crash"]}
    needed = [key for key in avoided if key in {(r["kind"], r["seed"]) for r in own if r["crash"]}]
    if avoided and own:
        text += f"; {len(needed)} of {len(avoided)} avoided crashes needed shared evidence"
    return text


def _draw(settings: CollisionSettings, table: Sequence[_Line]) -> Figure:
    shown = "both" if len(settings.kinds) > 1 else settings.kinds[0].value
    figure = Figure(figsize=(5.5, 4.0), layout="constrained")
    axes = figure.subplots()
    lines = [line for line in table if (line.kind, line.M, line.loss) == (shown, 10, 0.0)]
    none = next(line for line in lines if line.method == Method.NONE.value)
    for method in settings.methods:
        mine = [none, *(line for line in lines if line.method == method.value)]
        shares = np.array([line.share_with_radio for line in mine])
        p, low, high = np.array([(line.p_collision, line.low_95, line.high_95) for line in mine]).T
        label = method.value.upper()
        axes.errorbar(shares, p, [p - low, high - p], marker="o", capsize=3, label=label)
        if method is settings.methods[-1]:
            alarm = [line.paper_alarm_p_collision for line in mine]
            axes.plot(shares, alarm, "k--", label=f"{label}, the paper's alarm")
            no_radio = np.array([line.outcome_no_radio / line.runs for line in mine])
            bound = np.where(shares > 0.0, no_radio, p)
            axes.plot(shares, bound, "k:", label="no car to be warned")
    paper = PAPER_REDUCTION.get(settings.encounter.scene)
    if paper is not None and Method.MVS in settings.methods:
        at = none.p_collision * (1.0 - paper)
        axes.plot([_MOST_COMPARED], [at], "k*", markersize=12, label=f"paper: -{paper:.1%}")
    axes.set_xlabel("share of cars with a radio")
    axes.set_ylabel("probability of a collision")
    axes.set_ylim(0.0, 1.0)
    axes.legend()
    return figure
