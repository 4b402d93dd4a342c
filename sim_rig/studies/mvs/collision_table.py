"""The table of the collision studies: a line for each kind of event and case."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sim_rig.studies.campaigns.intervals import cluster_interval
from sim_rig.studies.mvs.collisions import CollisionRow, CollisionSettings, SimulatedRun
from sim_rig.studies.mvs.encounter import Method
from sim_rig.studies.mvs.outcomes import CrashOutcome


@dataclass(frozen=True, slots=True)
class CollisionLine:
    """One line of the table: a case and its results; times are medians."""

    kind: str
    method: str
    share_with_radio: float
    M: int
    loss: float
    events: int
    pairs: int
    """Distinct pairs of vehicles that crash in these events without radios."""
    angle_p10_deg: float
    angle_p50_deg: float
    angle_p90_deg: float
    """Percentiles of the angle between their headings."""
    p_collision: float
    """Share of the events with any crash; intervals are between pairs."""
    low_95: float
    high_95: float
    reduction: float
    """Fewer crashes than without radios, expected over the radios of the two vehicles."""
    reduction_low_95: float
    reduction_high_95: float
    avoidable: float
    """The most that any system can avoid: a driver who can act has a radio."""
    avoided: float
    caused: float
    warning_after_s: float
    false_warnings_per_h: float
    known_before_s: float
    """Before the crash, for a driver who can act, as the next one."""
    warned_before_s: float
    paper_alarm_p_collision: float
    """With the paper's alarm, as all that begin so."""
    paper_alarm_avoided: float
    paper_alarm_before_s: float
    paper_alarm_false_per_h: float
    outcome_no_radio: float
    """Of the crashes without radios (`CrashOutcome`), as all that begin so."""
    outcome_unknown: float
    outcome_unwarned: float
    outcome_too_late: float
    outcome_another: float
    outcome_avoided: float
    two_cars_p_collision: float
    """For the two vehicles of the event alone, as the next one."""
    two_cars_reduction: float
    paper_alarm_two_cars_reduction: float


_Key = tuple[str, Method, float, int, float]


def table(settings: CollisionSettings, rows: Sequence[CollisionRow]) -> list[CollisionLine]:
    """A line for each case, for each kind and for both kinds together."""
    both = [("both", row) for row in rows] if len(settings.kinds) > 1 else []
    by_case: dict[_Key, list[CollisionRow]] = {}
    for kind, row in [*both, *((row.kind.value, row) for row in rows)]:
        key = kind, row.method, row.share, row.entries, row.loss
        by_case.setdefault(key, []).append(row)
    return [_line(key, mine, by_case) for key, mine in by_case.items()]


def _line(
    key: _Key, mine: list[CollisionRow], by_case: dict[_Key, list[CollisionRow]]
) -> CollisionLine:
    """Results of one case; sums of runs are expected numbers over the radios of the two cars."""
    kind, method, share, entries, loss = key
    before = {_event(row): row for row in by_case[kind, Method.NONE, 0.0, 10, 0.0]}
    events, crashes = len(before), sum(row.crash for row in before.values())
    avoided, caused, fewer = changed(before.values(), mine)
    clusters = [row.pair or event for event, row in before.items()]
    crashed = [float(row.crash) for row in before.values()]
    low, high = cluster_interval(
        clusters, [a - b for a, b in zip(crashed, fewer, strict=True)], [1.0] * events
    )
    reduction_low, reduction_high = cluster_interval(clusters, fewer, crashed)
    run = [row for row in mine if isinstance(row, SimulatedRun)]
    hours = sum(row.weight * row.driven_s for row in run) / 3600.0

    def avoided_by_paper_alarm(crashes: str) -> float:
        """Expected number of crashes that are not among these with the paper's alarm."""
        return float(sum(r.probability for r in run if r.outcome and not getattr(r, crashes)))

    def of_crashes(number: float) -> float:
        return number / crashes if crashes else math.nan

    def per_hour(column: str) -> float:
        number = sum(row.weight * getattr(row, column) for row in run)
        return number / hours if hours else math.nan

    outcomes = dict.fromkeys(CrashOutcome, 0.0)
    for row in mine:
        if row.outcome is not None:
            outcomes[row.outcome] += row.probability
    paper_alarm_avoided = avoided_by_paper_alarm("paper_alarm_crash")
    paper_alarm_two_cars = avoided_by_paper_alarm("paper_alarm_same_pair")
    two_cars = outcomes[CrashOutcome.AVOIDED] + outcomes[CrashOutcome.ANOTHER]
    return CollisionLine(
        kind=kind,
        method=method.value,
        share_with_radio=share,
        M=entries,
        loss=loss,
        events=events,
        pairs=len({row.pair for row in before.values() if row.pair}),
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


def angle_deg(before: Iterable[CollisionRow], percent: float) -> float:
    """Percentile of the angles between the headings in the crashes without radios."""
    angles = [
        row.angle_deg
        for row in before
        if isinstance(row, SimulatedRun) and row.angle_deg is not None
    ]
    return float(np.percentile(angles, percent)) if angles else math.nan


def median(rows: Sequence[SimulatedRun], column: str) -> float:
    """Median of a column, weighted by probability; NaN without values."""
    values = sorted(
        (getattr(row, column), row.probability) for row in rows if getattr(row, column) is not None
    )
    if not values:
        return math.nan
    sums = np.cumsum([weight for _, weight in values])
    return float(values[int(np.searchsorted(sums, sums[-1] / 2.0))][0])


def _event(row: CollisionRow) -> tuple[str, int]:
    return row.kind.value, row.seed


class Change(NamedTuple):
    """Expected numbers of crashes by which radios change the events."""

    avoided: float
    """Crashes of events without radios that end in none with them."""
    caused: float
    """The other way round."""
    fewer: list[float]
    """By event without radios: how many crashes fewer it ends in."""


def changed(before: Iterable[CollisionRow], after: Iterable[CollisionRow]) -> Change:
    """Compare the crashes with and without radios seed by seed."""
    crashed = {_event(row): row.crash for row in before}
    fewer = dict.fromkeys(crashed, 0.0)
    avoided = caused = 0.0
    for row in after:
        event, weight = _event(row), row.weight
        fewer[event] += weight * (crashed[event] - row.crash)
        if crashed[event] and not row.crash:
            avoided += weight
        elif row.crash and not crashed[event]:
            caused += weight
    return Change(avoided, caused, list(fewer.values()))
