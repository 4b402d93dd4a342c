"""Crashes and messages by platoon length, share of radios and reaction time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from sim_rig.studies.campaigns.intervals import cluster_interval, half_interval
from sim_rig.studies.campaigns.study import Axes, Results, Study
from sim_rig.studies.lcca.chain import ChainCase, ChainSettings, Platoon


def axes(settings: ChainSettings) -> Axes:
    """All kinds of platoons, each with every share of radios."""
    return {
        "reaction_median_s": settings.reaction_medians_s,
        "cars": settings.cars,
        "sight": settings.sights,
        "cautions": settings.cautions,
        "share": settings.shares,
    }


@dataclass(frozen=True, slots=True)
class ChainRow:
    """One platoon under one share of radios."""

    cars: int
    sight: str
    cautions: str
    share: float
    reaction_median_s: float
    seed: int
    crashes: int
    followers: int
    """Cars with a radio behind a car with a radio."""
    known: int
    """Of those, the ones that know the lead when the first car brakes."""
    wrongly_known: int
    warned: int
    """By their groups, or cautioned."""
    cautioned: int
    wrongly_cautioned: int
    warn_messages: int
    events: int
    flooding_messages: int


@dataclass(frozen=True, slots=True)
class ChainLine:
    """One line of the table."""

    reaction_median_s: float
    cars: int
    sight: str
    cautions: str
    share_with_radio: float
    platoons: int
    crashes_per_platoon: float
    half_95: float
    """Of the 95 % interval of the crashes."""
    reduction: float
    """Share of the crashes without a radio that do not happen."""
    reduction_low_95: float
    reduction_high_95: float
    known: float
    """Share of the followers that know their lead, if both have a radio, when the first car
    brakes."""
    wrongly_known: int
    cautioned: int
    wrongly_cautioned: int
    """Of a car behind."""
    warn_messages_per_event: float
    flooding_messages_per_event: float


ChainResults = Results[ChainSettings, ChainRow, ChainLine]


def run(settings: ChainSettings, case: ChainCase) -> ChainRow:
    """Simulate one platoon."""
    platoon = Platoon(settings, case)
    platoon.drive()
    return ChainRow(
        cars=case.cars,
        sight=str(case.sight),
        cautions=str(case.cautions),
        share=case.share,
        reaction_median_s=case.reaction_median_s,
        seed=settings.seed + case.repetition,
        crashes=platoon.crashes(),
        followers=platoon.followers,
        known=platoon.known,
        wrongly_known=platoon.wrongly_known,
        warned=sum(math.isfinite(at) for at in platoon.warned_s),
        cautioned=platoon.cautioned,
        wrongly_cautioned=platoon.wrongly_cautioned,
        warn_messages=platoon.warn_messages,
        events=platoon.events,
        flooding_messages=platoon.flooding_messages,
    )


def table(settings: ChainSettings, rows: Sequence[ChainRow]) -> list[ChainLine]:
    """A line for each kind of platoon and share."""
    return [_line(case, rows) for case in STUDY.cases(settings)]


def _line(case: ChainCase, rows: Sequence[ChainRow]) -> ChainLine:
    of_kind = (case.reaction_median_s, case.cars, str(case.sight), str(case.cautions))

    def at(wanted: float) -> list[ChainRow]:
        return [
            row
            for row in rows
            if (row.reaction_median_s, row.cars, row.sight, row.cautions) == of_kind
            and row.share == wanted
        ]

    mine = at(case.share)
    crashes, none = [row.crashes for row in mine], [row.crashes for row in at(0.0)]
    events = sum(row.events for row in mine)
    error = half_interval(np.array(crashes))

    # The platoons are the same with and without radios; `none` is empty if no share is 0.
    avoided = [before - after for before, after in zip(none, crashes, strict=False)]
    low, high = cluster_interval(range(len(none)), avoided, none)
    followers = sum(row.followers for row in mine)

    def per_event(column: str) -> float:
        return sum(getattr(row, column) for row in mine) / events if events else 0.0

    return ChainLine(
        reaction_median_s=case.reaction_median_s,
        cars=case.cars,
        sight=str(case.sight),
        cautions=str(case.cautions),
        share_with_radio=case.share,
        platoons=len(mine),
        crashes_per_platoon=float(np.mean(crashes)),
        half_95=float(error),
        reduction=1.0 - sum(crashes) / sum(none) if sum(none) else math.nan,
        reduction_low_95=low,
        reduction_high_95=high,
        known=sum(row.known for row in mine) / followers if followers else math.nan,
        wrongly_known=sum(row.wrongly_known for row in mine),
        cautioned=sum(row.cautioned for row in mine),
        wrongly_cautioned=sum(row.wrongly_cautioned for row in mine),
        warn_messages_per_event=per_event("warn_messages"),
        flooding_messages_per_event=per_event("flooding_messages"),
    )


def _platoon_of(line: ChainLine) -> tuple[float, int, str, str]:
    return line.reaction_median_s, line.cars, line.sight, line.cautions


def picture(results: ChainResults) -> Figure:
    """Draw crashes and messages over the share of cars with a radio, for each kind of platoon."""
    table = results.table
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    for platoon in dict.fromkeys(map(_platoon_of, table)):
        mine = [line for line in table if _platoon_of(line) == platoon]
        median_s, cars, sight, cautions = platoon
        shares = [line.share_with_radio for line in mine]
        label = f"{cars} cars, {median_s:g} s, {sight}"
        if cautions != "off":
            label += f", cautions {cautions}"
        left.errorbar(
            shares,
            [line.crashes_per_platoon for line in mine],
            [line.half_95 for line in mine],
            marker="o",
            capsize=3,
            label=label,
        )
        messages = [line.warn_messages_per_event for line in mine]
        right.plot(shares, messages, marker="o", label=f"{label}: LCCA")
    last = [line for line in table if _platoon_of(line) == _platoon_of(table[-1])]
    right.plot(
        [line.share_with_radio for line in last],
        [line.flooding_messages_per_event for line in last],
        "k--",
        label=f"{table[-1].cars} cars: flooding",
    )
    left.set_ylabel("crashes a platoon")
    right.set_ylabel("messages a warning")
    for axes in (left, right):
        axes.set_xlabel("share of cars with a radio")
        axes.legend(fontsize=7)
    return figure


def summary(results: ChainResults) -> str:
    """Crashes and messages of the longest platoon."""
    first, last = results.table[-len(results.settings.shares)], results.table[-1]
    return (
        f"{last.cars} cars, {last.sight}: {first.crashes_per_platoon:.1f} crashes a platoon at a"
        f" share of {first.share_with_radio:g}, {last.crashes_per_platoon:.1f} at"
        f" {last.share_with_radio:g}; {last.warn_messages_per_event:.1f} messages a warning,"
        f" {last.flooding_messages_per_event:.1f} by flooding"
    )


STUDY = Study(
    name="lcca-chain",
    sentence="How many rear-end crashes of a platoon LCCA avoids, and with how many messages.",
    settings=ChainSettings,
    axes=axes,
    repeat=lambda settings: settings.runs,
    case=ChainCase,
    run=run,
    row=ChainRow,
    table=table,
    line=ChainLine,
    picture=picture,
    summary=summary,
)
