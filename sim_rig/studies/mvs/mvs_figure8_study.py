"""The MVS paper's Fig. 8: different measurements and estimates (MEs) received, by method."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from onboard.mvs.settings import Selection
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


@dataclass(frozen=True, slots=True)
class SharingLine:
    """One line of the table of Fig. 8."""

    share_with_radio: float
    M: int
    method: str
    different_mes: float
    half_95: float
    """Of the 95 % interval of the mean."""


SharingResults = Results[SharingSettings, SharingRow, SharingLine]


def table(settings: SharingSettings, rows: Sequence[SharingRow]) -> list[SharingLine]:
    """A line for each share, M and method."""
    return [
        _line(share, entries, method, rows)
        for share in settings.shares
        for entries in settings.entries
        for method in settings.methods
    ]


def _line(share: float, entries: int, method: Selection, rows: Sequence[SharingRow]) -> SharingLine:
    values = [
        row.different
        for row in rows
        if (row.method, row.entries, row.share) == (method, entries, share)
    ]
    half = float(half_interval(np.array(values)))
    return SharingLine(share, entries, method.value, float(np.mean(values)), half)


def picture(results: SharingResults) -> Figure:
    """Draw the number over M, a panel for each share."""
    settings = results.settings
    figure = Figure(figsize=(3.0 * len(settings.shares), 3.2), layout="constrained")
    panels = figure.subplots(1, len(settings.shares), sharey=True, squeeze=False)[0]
    for panel, share in zip(panels, settings.shares, strict=True):
        for method in settings.methods:
            mine = [
                line
                for line in results.table
                if (line.share_with_radio, line.method) == (share, method.value)
            ]
            panel.errorbar(
                [line.M for line in mine],
                [line.different_mes for line in mine],
                [line.half_95 for line in mine],
                marker="o",
                capsize=3,
                label=method.value.upper(),
            )
        panel.set_title(f"{share:.0%} with a radio")
        panel.set_xlabel("M, entries in a footer")
    panels[0].set_ylabel("different MEs received in 0.1 s")
    panels[0].legend()
    return figure


def summary(results: SharingResults) -> str:
    """In how many cells MVS delivers most."""
    cells: dict[tuple[float, int], dict[str, float]] = {}
    for line in results.table:
        cells.setdefault((line.share_with_radio, line.M), {})[line.method] = line.different_mes
    wins = sum(_mvs_delivers_most(cell) for cell in cells.values())
    return f"MVS delivers most in {wins} of {len(cells)} cells (paper: in all)"


def _mvs_delivers_most(cell: dict[str, float]) -> bool:
    """Whether MVS delivers more MEs than every other method."""
    others = [count for method, count in cell.items() if method != Selection.MVS.value]
    return cell.get(Selection.MVS.value, 0.0) > max(others, default=0.0)


STUDY = Study(
    name="mvs-figure8",
    sentence="How much a car receives about cars without a radio, by method and size of footer.",
    settings=SharingSettings,
    prepare=prepared,
    axes=axes,
    case=SharingCase,
    run=run,
    row=SharingRow,
    table=table,
    line=SharingLine,
    picture=picture,
    summary=summary,
)
