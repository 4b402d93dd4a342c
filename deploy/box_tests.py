"""The table of what the targets that test a box have measured, each with the build that it tested.

    python -m deploy.box_tests TARGET FILE     takes the figures that `sim-rig ladder` has written

A target's rows replace those of its run before; the rows of other targets stay.
"""

import csv
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from onboard.recorder.build import present_build

TABLE = Path(__file__).parents[1] / "docs" / "tables" / "box-tests.csv"
TARGETS = ("hil-test", "box-test", "box-ladder", "vm-test", "vm-ladder")
"""Of the Makefile, in the order of the rows."""


class BoxFigure(NamedTuple):
    """One result; texts, since some are words and some have no limit."""

    figure: str
    value: str
    unit: str
    limit: str


def record(target: str, build: str, figures: Iterable[BoxFigure], table: Path = TABLE) -> None:
    """Write the figures of a target in place of its earlier ones.

    Args:
        target: one of `TARGETS`.
        build: name of the build that was tested.
        figures: what was measured.
        table: CSV file, which is made if there is none.
    """
    head = ("target", "build", *BoxFigure._fields)
    rows = [row for row in _rows(table)[1:] if row[0] != target]
    rows += [[target, build, *figure] for figure in figures]
    rows.sort(key=lambda row: TARGETS.index(row[0]))
    with table.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([head, *rows])


def read_figures(file: Path) -> list[BoxFigure]:
    """Return the figures that `sim-rig ladder` has written."""
    return [BoxFigure(*row) for row in _rows(file)[1:]]


def _rows(file: Path) -> list[list[str]]:
    if not file.exists():
        return []
    with file.open(newline="", encoding="utf-8") as opened:
        return list(csv.reader(opened))


if __name__ == "__main__":
    target, ladder = sys.argv[1:]
    record(target, present_build().name, read_figures(Path(ladder)))
