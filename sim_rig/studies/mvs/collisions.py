"""The MVS paper's Fig. 9 and Fig. 3: probability that an event ends in a crash, by share of radios.

One run is one event of one seed under one case. Event, drivers and the order in which cars get a
radio depend on the seed alone, so cases are compared run by run. The two cars that crash without
radios get them in all four ways, each with its probability: who of them has one decides most, and
is left to no draw.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from pydantic import Field

from onboard.settings import Settings
from sim_rig.roads.crashes import Crash
from sim_rig.roads.events import TrafficEventKind
from sim_rig.scenario.setting_types import Several, Share
from sim_rig.studies.campaigns.campaign import Row, Workers, run_campaign
from sim_rig.studies.campaigns.intervals import cluster_interval
from sim_rig.studies.campaigns.results import write_results
from sim_rig.studies.mvs.encounter import EncounterCase, Encounters, EncounterSettings, Method
from sim_rig.studies.mvs.outcomes import CrashOutcome
from sim_rig.studies.mvs.scenes import SceneName, SceneSource, available_scene
from sim_rig.studies.mvs.world import FooterSize

PAPER_REDUCTION: dict[SceneSource, float] = {
    SceneName.CROSSING: 0.615,
    SceneName.SUMO_CROSSING: 0.615,
    SceneName.CITY: 0.601,
}
"""Reduction of the collision probability by MVS at 40 %: all that the paper prints of Fig. 9."""
_MOST_COMPARED = 0.4
_PAIR_RADIOS = ((False, False), (True, False), (False, True), (True, True))


class CollisionSettings(Settings):
    """One campaign."""

    seed: int = Field(1, ge=0)
    """Number of the first event; each further event has the next."""
    runs: int = Field(500, ge=1)
    """Events of each kind."""
    kinds: Several[TrafficEventKind] = tuple(TrafficEventKind)
    """Kinds of events."""
    shares: Several[Share] = (0.1, 0.2, 0.3, 0.4, 0.6, 0.8)
    """Shares of the cars with a radio."""
    methods: Several[Method] = (Method.DSRC, Method.OWN, Method.MVS)
    """At every share."""
    compared_at: float | None = Field(default=_MOST_COMPARED, gt=0.0, le=1.0)
    """Share at which also MO, RS, other footer sizes and a loss of half of all messages are run."""
    entries: tuple[FooterSize, ...] = (5, 20)
    """M, where it is not 10."""
    unaffected_every: int = Field(1, ge=1, le=100)
    """Events in which radios cannot avoid anything (no crash, or no car that can act has a radio)
    are run with radios only once in so many, with that many times the weight: they show what
    warnings cause."""
    encounter: EncounterSettings = EncounterSettings()
    """What all runs have in common."""


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
    return [
        case if case.method is Method.NONE else replace(case, pair_radios=radios)
        for case in dict.fromkeys(shape)
        for radios in (_PAIR_RADIOS if case.method is not Method.NONE else (None,))
    ]


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
    simulator = encounters(settings.encounter)
    of = simulator.event(case.kind, seed)
    row: Row = {
        "scene": str(of.source),
        "kind": case.kind.value,
        "method": case.method.value,
        "share": case.share,
        "entries": case.entries,
        "loss": case.loss,
        "seed": seed,
        "pair": None,
        "pair_radios": case.pair_radios,
        "probability": 1.0,
        "weight": 1.0,
    }
    if case.pair_radios is not None:
        before, is_unaffected = simulator.without_radios(case, seed)
        row["pair"] = _pair(of.source, before)
        row["probability"] = _probability(case.share, case.pair_radios, has_pair=before is not None)
        every = settings.unaffected_every if is_unaffected else 1
        is_run = row["probability"] > 0.0 and seed % every == 0
        row["weight"] = row["probability"] * every if is_run else 0.0
        if not is_run:
            result = CrashOutcome.NO_RADIO.value if before is not None else None
            return row | {"crash": before is not None, "outcome": result}
    outcome = simulator.run(case, seed)
    if case.method is Method.NONE:
        row["pair"] = _pair(of.source, outcome.crash)
    return row | {
        "crash": outcome.crash is not None,
        "speed_m_s": outcome.crash.speed_m_s if outcome.crash else None,
        "angle_deg": math.degrees(outcome.crash.angle_rad) if outcome.crash else None,
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


def _pair(source: SceneSource, crash: Crash | None) -> str | None:
    return None if crash is None else "+".join([str(source), *sorted(crash.names)])


def _probability(share: float, pair_radios: tuple[bool, bool], *, has_pair: bool) -> float:
    """Of these radios of the two cars of the crash; an event without a crash is run once."""
    if not has_pair:
        return float(pair_radios == _PAIR_RADIOS[0])
    return math.prod(share if has_radio else 1.0 - share for has_radio in pair_radios)


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
    return _summary(*_results(out_dir, settings or CollisionSettings(), workers))


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
    _, table, _ = _results(out_dir, settings or Figure3Settings(), workers)
    first, last = table[0], table[-1]
    return (
        f"P(collision) {first.p_collision:.2f} without radios,"
        f" {last.p_collision:.2f} at a share of {last.share_with_radio:g}"
    )


def with_available_scenes(encounter: EncounterSettings) -> EncounterSettings:
    """The settings with the scenes that are used, given the recordings that are present now."""
    scenes = dict.fromkeys(map(available_scene, encounter.scenes))
    return encounter.model_copy(update={"scenes": tuple(scenes)})


def _results(
    out_dir: Path, settings: CollisionSettings, workers: Workers | None
) -> tuple[CollisionSettings, list["_Line"], list[Row]]:
    """Run the campaign; return and write its settings, as used, its table and its runs."""
    encounter = with_available_scenes(settings.encounter)
    settings = settings.model_copy(update={"encounter": encounter})
    numbers = range(len(cases(settings)) * settings.runs)
    rows = run_campaign(run_one, settings, numbers, out_dir / "runs", workers or Workers())
    table = _table(settings, rows)
    write_results(out_dir, _Line._fields, table, settings, _draw(settings, table))
    return settings, table, rows


class _Line(NamedTuple):
    """One line of the table: a case and its results."""

    kind: str
    method: str
    share_with_radio: float
    M: int
    loss: float
    events: int
    pairs: int
    angle_p10_deg: float
    angle_p50_deg: float
    angle_p90_deg: float
    p_collision: float
    low_95: float
    high_95: float
    reduction: float
    reduction_low_95: float
    reduction_high_95: float
    avoidable: float
    avoided: float
    caused: float
    warning_after_s: float
    false_warnings_per_h: float
    known_before_s: float
    warned_before_s: float
    paper_alarm_p_collision: float
    paper_alarm_avoided: float
    paper_alarm_before_s: float
    paper_alarm_false_per_h: float
    outcome_no_radio: float
    outcome_unknown: float
    outcome_unwarned: float
    outcome_too_late: float
    outcome_another: float
    outcome_avoided: float
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
    """Results of one case; sums of runs are expected numbers over the radios of the two cars."""
    kind, method, share, entries, loss = key
    before = {_event(row): row for row in by_case[kind, Method.NONE.value, 0.0, 10, 0.0]}
    events, crashes = len(before), sum(row["crash"] for row in before.values())
    avoided, caused, fewer = changed(before.values(), mine)
    clusters = [row["pair"] or event for event, row in before.items()]
    crashed = [float(row["crash"]) for row in before.values()]
    low, high = cluster_interval(
        clusters, [a - b for a, b in zip(crashed, fewer, strict=True)], [1.0] * events
    )
    reduction_low, reduction_high = cluster_interval(clusters, fewer, crashed)
    run = [row for row in mine if "driven_s" in row]
    hours = sum(row["weight"] * row["driven_s"] for row in run) / 3600.0

    def avoided_by_paper_alarm(crashes: str) -> float:
        """Expected number of crashes that are not among these with the paper's alarm."""
        return float(sum(r["probability"] for r in run if r["outcome"] and not r[crashes]))

    def of_crashes(number: float) -> float:
        return number / crashes if crashes else math.nan

    def per_hour(column: str) -> float:
        number = sum(row["weight"] * row[column] for row in run)
        return number / hours if hours else math.nan

    outcomes = dict.fromkeys(CrashOutcome, 0.0)
    for row in mine:
        if row["outcome"] is not None:
            outcomes[CrashOutcome(row["outcome"])] += row["probability"]
    paper_alarm_avoided = avoided_by_paper_alarm("paper_alarm_crash")
    paper_alarm_two_cars = avoided_by_paper_alarm("paper_alarm_same_pair")
    two_cars = outcomes[CrashOutcome.AVOIDED] + outcomes[CrashOutcome.ANOTHER]
    return _Line(
        kind=kind,
        method=method,
        share_with_radio=share,
        M=entries,
        loss=loss,
        events=events,
        pairs=len({row["pair"] for row in before.values() if row["pair"]}),
        **{f"angle_p{share}_deg": angle_deg(before.values(), share) for share in (10, 50, 90)},
        p_collision=(crashes - avoided + caused) / events,
        low_95=low,
        high_95=high,
        reduction=of_crashes(avoided - caused),
        reduction_low_95=reduction_low,
        reduction_high_95=reduction_high,
        avoidable=of_crashes(sum(outcomes.values()) - outcomes[CrashOutcome.NO_RADIO]),
        avoided=avoided,
        caused=caused,
        warning_after_s=median(run, "first_warning_s"),
        false_warnings_per_h=per_hour("false_warnings"),
        known_before_s=median(run, "known_before_s"),
        warned_before_s=median(run, "warned_before_s"),
        paper_alarm_p_collision=(crashes - paper_alarm_avoided) / events,
        paper_alarm_avoided=paper_alarm_avoided,
        paper_alarm_before_s=median(run, "paper_alarm_before_s"),
        paper_alarm_false_per_h=per_hour("paper_alarm_false"),
        **{f"outcome_{outcome.value}": number for outcome, number in outcomes.items()},
        two_cars_p_collision=(crashes - two_cars) / events,
        two_cars_reduction=of_crashes(two_cars),
        paper_alarm_two_cars_reduction=of_crashes(paper_alarm_two_cars),
    )


def angle_deg(before: Iterable[Row], percent: float) -> float:
    """Percentile of the angles between the headings in the crashes without radios."""
    angles = [row["angle_deg"] for row in before if row["crash"]]
    return float(np.percentile(angles, percent)) if angles else math.nan


def median(rows: Sequence[Row], column: str) -> float:
    """Median of a column, weighted by probability; NaN without values."""
    values = sorted((row[column], row["probability"]) for row in rows if row[column] is not None)
    if not values:
        return math.nan
    sums = np.cumsum([weight for _, weight in values])
    return float(values[int(np.searchsorted(sums, sums[-1] / 2.0))][0])


def _event(row: Row) -> tuple[str, int]:
    return str(row.get("event", row["kind"])), int(row["seed"])


class Change(NamedTuple):
    """Expected numbers of crashes by which radios change the events."""

    avoided: float
    """Crashes of events without radios that end in none with them."""
    caused: float
    """The other way round."""
    fewer: list[float]
    """By event without radios: how many crashes fewer it ends in."""


def changed(before: Iterable[Row], after: Iterable[Row]) -> Change:
    """Compare the crashes with and without radios seed by seed."""
    crashed = {_event(row): row["crash"] for row in before}
    fewer = dict.fromkeys(crashed, 0.0)
    avoided = caused = 0.0
    for row in after:
        event, weight = _event(row), row["weight"]
        fewer[event] += weight * (crashed[event] - row["crash"])
        if crashed[event] and not row["crash"]:
            avoided += weight
        elif row["crash"] and not crashed[event]:
            caused += weight
    return Change(avoided, caused, list(fewer.values()))


def _summary(settings: CollisionSettings, table: Sequence[_Line], rows: Sequence[Row]) -> str:
    """What MVS avoids at the share of which the paper gives a number."""
    shown = _shown(settings)
    line = next(
        (
            line
            for line in table
            if (line.kind, line.method, line.share_with_radio, line.M, line.loss)
            == (shown, Method.MVS.value, _MOST_COMPARED, 10, 0.0)
        ),
        None,
    )
    if line is None:
        return f"{len(rows)} runs"
    if math.isnan(line.reduction):
        return f"no event ends in a crash without radios ({line.events} events)"
    paper = _paper_reduction(settings)
    text = f"at {_MOST_COMPARED:.0%} MVS reduces crashes by {line.reduction:.1%}"
    text += f" ({line.reduction_low_95:.0%} to {line.reduction_high_95:.0%}, {line.pairs} pairs)"
    text += f" of {line.avoidable:.0%} that can be avoided"
    text += f", of the two cars alone {line.two_cars_reduction:.1%}"
    return text if paper is None else f"{text} (paper: {paper:.1%})"


def _paper_reduction(settings: CollisionSettings) -> float | None:
    """What the paper prints for the scene of a campaign; None for several."""
    scenes = settings.encounter.scenes
    return PAPER_REDUCTION.get(scenes[0]) if len(scenes) == 1 else None


def _shown(settings: CollisionSettings) -> str:
    """Kind of events of figure and summary."""
    return "both" if len(settings.kinds) > 1 else settings.kinds[0].value


def _draw(settings: CollisionSettings, table: Sequence[_Line]) -> Figure:
    shown = _shown(settings)
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
            no_radio = np.array([line.outcome_no_radio / line.events for line in mine])
            bound = np.where(shares > 0.0, no_radio, p)
            axes.plot(shares, bound, "k:", label="no car to be warned")
    paper = _paper_reduction(settings)
    if paper is not None and Method.MVS in settings.methods:
        at = none.p_collision * (1.0 - paper)
        axes.plot([_MOST_COMPARED], [at], "k*", markersize=12, label=f"paper: -{paper:.1%}")
    axes.set_xlabel("share of cars with a radio")
    axes.set_ylabel("probability of a collision")
    axes.set_ylim(0.0, 1.0)
    axes.legend()
    return figure
