"""The MVS paper's Table I: how many measurements each selection uses, and how often again."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from onboard.mvs.settings import Selection
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.campaigns.intervals import half_interval
from sim_rig.studies.campaigns.study import Results, Study
from sim_rig.studies.mvs.sharing import (
    SharingCase,
    SharingRow,
    SharingSettings,
    axes,
    prepared,
    run,
)
from sim_rig.studies.mvs.world_settings import FooterSize

PAPER_SHARES = (0.1, 0.2, 0.3, 0.4)
PAPER = {
    "rs": {"reused": (0.2, 1.2, 4.6, 9.4), "selected": (1.4, 3.5, 7.2, 13.2)},
    "mvs": {"reused": (0.0, 0.0, 0.0, 0.0), "selected": (1.3, 1.7, 3.1, 4.6)},
}
"""At `PAPER_SHARES`."""


class Table1Settings(SharingSettings):
    """Table I: cars select as MVS does; the selection that RS would make is counted as well."""

    entries: Several[FooterSize] = (10,)
    methods: Several[Selection] = (Selection.MVS,)


@dataclass(frozen=True, slots=True)
class SelectionLine:
    """One line of the table: a method at a share; the paper's values if the shares are its own."""

    method: str
    share_with_radio: float
    reused: float
    reused_half_95: float
    """Of the 95 % interval of the mean over the seeds."""
    paper_reused: float | str
    selected: float
    selected_half_95: float
    paper_selected: float | str


def table(settings: Table1Settings, rows: Sequence[SharingRow]) -> list[SelectionLine]:
    """A line for each method and share."""
    return [
        _line(method, at, settings, rows) for method in PAPER for at in range(len(settings.shares))
    ]


def _line(
    method: str, at: int, settings: Table1Settings, rows: Sequence[SharingRow]
) -> SelectionLine:
    share = settings.shares[at]
    mine = [row for row in rows if row.share == share]

    def mean_and_half(what: str) -> tuple[float, float]:
        of_seeds = np.array([getattr(row, f"{what}_{method}") for row in mine])
        return float(of_seeds.mean()), float(half_interval(of_seeds))

    def paper(what: str) -> float | str:
        return PAPER[method][what][at] if settings.shares == PAPER_SHARES else ""

    reused, selected = mean_and_half("reused"), mean_and_half("selected")
    return SelectionLine(method, share, *reused, paper("reused"), *selected, paper("selected"))


def summary(results: Results[Table1Settings, SharingRow, SelectionLine]) -> str:
    """How many measurements any fused state counts twice."""
    in_states = sum(row.reused_in_states for row in results.rows)
    return f"measurements used twice in any fused state: {in_states}"


STUDY = Study(
    name="mvs-table1",
    sentence="How many measurements MVS and random selection use, and how many of them again.",
    settings=Table1Settings,
    prepare=prepared,
    axes=axes,
    case=SharingCase,
    run=run,
    row=SharingRow,
    table=table,
    line=SelectionLine,
    summary=summary,
)
