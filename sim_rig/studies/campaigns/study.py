"""What a study is: settings, axes, one run with its row, and what is made of all rows.

A study is one file, `PACKAGE/NAME_study.py`, which exports `STUDY`. Its runs are all combinations
of its axes, as those of `${controller = 0, 1, 2}` in OMNeT++; the last axis changes fastest, and
all combinations are repeated.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pydantic import TypeAdapter, ValidationError

from onboard.errors import UserError
from onboard.settings import Settings
from sim_rig.studies.campaigns.campaign import CampaignError, StoredRow, Workers, run_campaign
from sim_rig.studies.campaigns.progress import run_progress
from sim_rig.studies.campaigns.results import write_settings, write_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Axes = dict[str, Sequence[Any]]
"""The values of each axis by its name, which is a field of the study's case."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """What defines a run, apart from the settings; a study's own one has a field for each axis."""

    number: int
    """Of the run in the campaign."""
    repetition: int
    """How often the same combination of the axes comes before it."""


SettingsT = TypeVar("SettingsT", bound=Settings)
CaseT = TypeVar("CaseT", bound=Case)
RowT = TypeVar("RowT")
LineT = TypeVar("LineT")


@dataclass(frozen=True, slots=True)
class Results(Generic[SettingsT, RowT, LineT]):
    """What a picture and a summary are made of."""

    settings: SettingsT
    rows: Sequence[RowT]
    """Of the runs, by their numbers."""
    table: Sequence[LineT]


@dataclass(frozen=True, slots=True)
class _Run(Generic[SettingsT, CaseT, RowT]):
    """One run by its number; other processes can import all that it holds."""

    axes: Callable[[SettingsT], Axes]
    case: type[CaseT]
    run: Callable[[SettingsT, CaseT], RowT]
    row: type[RowT] | UnionType

    def __call__(self, settings: SettingsT, number: int) -> StoredRow:
        found = self.run(settings, case_of(self.case, self.axes(settings), number))
        return _stored(self.row, found)


def _no_axes(_settings: Settings) -> Axes:
    return {}


def _once(_settings: Settings) -> int:
    return 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Study(Generic[SettingsT, CaseT, RowT, LineT]):
    """A study. What a worker process needs (`axes`, `run`) is defined at the top of a module."""

    name: str
    """With dashes what its file is called."""
    sentence: str
    """What it finds out."""
    settings: type[SettingsT]
    default: SettingsT | None = None
    """Settings if none are given; by default each setting has its own default."""
    takes_settings: bool = True
    needs: str = ""
    """What a user is told who gives no settings, if one has no default."""
    prepare: Callable[[SettingsT], SettingsT] = lambda settings: settings
    """Check and complete the settings before the first run."""

    axes: Callable[[SettingsT], Axes] = _no_axes
    repeat: Callable[[SettingsT], int] = _once
    """How often all combinations of the axes are run."""
    case: type[CaseT]
    run: Callable[[SettingsT, CaseT], RowT]
    """One run, which takes every seed from settings and case."""
    row: type[RowT] | UnionType | None = None
    """What a run gives, a dataclass that JSON can represent. `None` for a study of one run, which
    is not stored."""
    about_s: Callable[[SettingsT], float] = lambda _: 2.0
    """How long a study of one run takes on one core."""
    folder: Callable[[SettingsT], str] = lambda _: "runs"
    """Of the stored runs, in the study's folder."""

    table: Callable[[SettingsT, Sequence[RowT]], Sequence[LineT]] = lambda *_: ()
    line: type[LineT] | None = None
    """A dataclass or named tuple whose fields are the columns, or a dict; `None` for no table."""
    picture: "Callable[[Results[SettingsT, RowT, LineT]], Figure] | None" = None
    more: Callable[[Path, Results[SettingsT, RowT, LineT], Workers], None] | None = None
    """Write further files."""
    summary: Callable[[Results[SettingsT, RowT, LineT]], str]

    def write(self, out_dir: Path, given: SettingsT | None, workers: Workers) -> str:
        """Run the study, write its results into a folder, and return the summary.

        Raises:
            UserError: a required setting is missing, or the settings do not fit.
            CampaignError: as `run_campaign`.
        """
        settings = self.prepare(self._settings(given))
        if self.row is not None:
            return self._write(out_dir, settings, workers)
        with run_progress(self.name, self.about_s(settings)):
            return self._write(out_dir, settings, workers)

    def _write(self, out_dir: Path, settings: SettingsT, workers: Workers) -> str:
        rows = self.rows(settings, out_dir, workers)
        results = Results(settings, rows, self.table(settings, rows))
        if self.line is not None:
            write_table(out_dir, columns(self.line, results.table), map(_values, results.table))
        write_settings(out_dir, settings)
        if self.picture is not None:
            self.picture(results).savefig(out_dir / "figure.png", dpi=110)
        if self.more is not None:
            self.more(out_dir, results, workers)
        return self.summary(results)

    def numbers(self, settings: SettingsT) -> range:
        """The numbers of all runs."""
        return range(self.repeat(settings) * count_of(self.axes(settings)))

    def case_of(self, settings: SettingsT, number: int) -> CaseT:
        """The case of a run."""
        return case_of(self.case, self.axes(settings), number)

    def cases(self, settings: SettingsT) -> list[CaseT]:
        """All combinations of the axes, once."""
        return [self.case_of(settings, number) for number in range(count_of(self.axes(settings)))]

    def one(self, settings: SettingsT, number: int) -> RowT:
        """One run, by its number."""
        return self.run(settings, self.case_of(settings, number))

    def rows(
        self,
        settings: SettingsT,
        out_dir: Path,
        workers: Workers,
        numbers: Sequence[int] | None = None,
    ) -> list[RowT]:
        """These runs, or all; those that `out_dir` does not hold are executed."""
        numbers = self.numbers(settings) if numbers is None else numbers
        if self.row is None:
            return [self.one(settings, number) for number in numbers]
        folder = out_dir / self.folder(settings)
        run = _Run(self.axes, self.case, self.run, self.row)
        stored = run_campaign(run, settings, numbers, folder, workers, name=self.name)
        return [
            self.row_of(each, f"{folder}, run {number}")
            for number, each in zip(numbers, stored, strict=True)
        ]

    def row_of(self, stored: StoredRow, where: str) -> RowT:
        """A row as it is stored.

        Raises:
            CampaignError: it has other values.
        """
        kind: Any = self.row
        try:
            row: RowT = _adapter(kind).validate_python(stored)
        except ValidationError as error:
            raise CampaignError(f"{where}: not a run of this version: remove the folder") from error
        return row

    def stored(self, row: RowT) -> StoredRow:
        """The row as it is stored."""
        return _stored(self.row, row)

    def _settings(self, given: SettingsT | None) -> SettingsT:
        if given is not None:
            return given
        if self.needs:
            raise UserError(self.needs)
        return self.default or self.settings()


AnyStudy = Study[Any, Any, Any, Any]


def count_of(axes: Axes) -> int:
    """How many combinations the axes have."""
    return math.prod(map(len, axes.values()))


def case_of(case: type[CaseT], axes: Axes, number: int) -> CaseT:
    """The combination of the axes with this number; the last axis changes fastest."""
    rest, chosen = number, {}
    for name, values in reversed(list(axes.items())):
        rest, at = divmod(rest, len(values))
        chosen[name] = values[at]
    return case(number=number, repetition=rest, **chosen)


def columns(line: type[object], table: Sequence[object]) -> list[str]:
    """The header of a table, of lines that are dataclasses, named tuples or dicts."""
    if is_dataclass(line):
        return [field.name for field in fields(line)]
    if named := getattr(line, "_fields", ()):
        return list(named)
    return [str(name) for first in table[:1] if isinstance(first, Mapping) for name in first]


def _values(line: object) -> list[object]:
    if isinstance(line, Mapping):
        return list(line.values())
    return [getattr(line, name) for name in columns(type(line), ())]


@cache
def _adapter(row: Any) -> TypeAdapter[Any]:
    return TypeAdapter(row)


def _stored(kind: Any, row: object) -> StoredRow:
    stored: StoredRow = _adapter(kind).dump_python(row, mode="json", by_alias=True)
    return stored
