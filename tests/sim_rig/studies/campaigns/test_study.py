"""A study is settings, axes, one run with its row, and a table; axes number its runs."""

import pickle
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from onboard.errors import UserError
from onboard.settings import Settings
from sim_rig.studies.campaigns.campaign import CampaignError, Workers
from sim_rig.studies.campaigns.catalogue import find_study, study_files
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study


class DiceSettings(Settings):
    seed: int = 1
    runs: int = 2
    sides: tuple[int, ...] = (4, 6, 8)
    colours: tuple[str, ...] = ("red", "blue")


@dataclass(frozen=True, slots=True, kw_only=True)
class DiceCase(Case):
    sides: int
    colour: str


@dataclass(frozen=True, slots=True)
class DiceRow:
    colour: str
    eyes: int


@dataclass(frozen=True, slots=True)
class DiceLine:
    colour: str
    mean: float


def axes(settings: DiceSettings) -> Axes:
    return {"sides": settings.sides, "colour": settings.colours}


def throw(settings: DiceSettings, case: DiceCase) -> DiceRow:
    seed = settings.seed + case.repetition
    return DiceRow(colour=case.colour, eyes=1 + (seed + case.number) % case.sides)


def means(settings: DiceSettings, rows: Sequence[DiceRow]) -> list[DiceLine]:
    by_colour = {
        each: [row.eyes for row in rows if row.colour == each] for each in settings.colours
    }
    return [DiceLine(each, sum(eyes) / len(eyes)) for each, eyes in by_colour.items()]


def total(results: Results[DiceSettings, DiceRow, DiceLine]) -> str:
    return f"{sum(row.eyes for row in results.rows)} eyes"


DICE = Study(
    name="dice",
    sentence="How many eyes dice show.",
    settings=DiceSettings,
    axes=axes,
    repeat=lambda settings: settings.runs,
    case=DiceCase,
    run=throw,
    row=DiceRow,
    table=means,
    line=DiceLine,
    summary=total,
)


def test_the_last_axis_changes_fastest_and_all_combinations_are_repeated() -> None:
    settings = DiceSettings()

    runs = [DICE.case_of(settings, number) for number in DICE.numbers(settings)]

    first = [(4, "red"), (4, "blue"), (6, "red"), (6, "blue"), (8, "red"), (8, "blue")]
    assert [(case.sides, case.colour) for case in runs] == 2 * first
    assert [case.number for case in runs] == list(range(12))
    assert Counter(case.repetition for case in runs) == {0: 6, 1: 6}
    assert DICE.cases(settings) == runs[:6]


def test_a_run_beyond_the_settings_is_a_further_repetition() -> None:
    """A stored campaign may hold more runs than its settings say, as their number may change."""
    case = DICE.case_of(DiceSettings(), 13)

    assert (case.sides, case.colour, case.repetition) == (4, "blue", 2)


def test_the_columns_of_the_table_are_the_fields_of_a_line(tmp_path: Path) -> None:
    summary = DICE.write(tmp_path, None, Workers())

    rows = [DICE.one(DiceSettings(), number) for number in range(12)]
    red = [row.eyes for row in rows if row.colour == "red"]
    header, first, _ = (tmp_path / "table.csv").read_text().splitlines()
    assert header == "colour,mean"
    assert first == f"red,{sum(red) / len(red):.6g}"
    assert summary == f"{sum(row.eyes for row in rows)} eyes"


def test_a_stored_run_is_the_row_that_it_was(tmp_path: Path) -> None:
    rows = DICE.rows(DiceSettings(), tmp_path, Workers())

    assert rows == [DICE.one(DiceSettings(), number) for number in range(12)]
    assert DICE.rows(DiceSettings(), tmp_path, Workers()) == rows
    stored = (tmp_path / "runs/runs.jsonl").read_text().splitlines()
    assert stored[0] == f'{{"run": 0, "colour": "red", "eyes": {rows[0].eyes}}}'


def test_a_stored_run_with_other_values_is_an_error(tmp_path: Path) -> None:
    DICE.rows(DiceSettings(), tmp_path, Workers())
    stored = tmp_path / "runs/runs.jsonl"
    stored.write_text(stored.read_text().replace('"eyes"', '"spots"'))

    with pytest.raises(CampaignError, match="run 0: not a run of this version"):
        DICE.rows(DiceSettings(), tmp_path, Workers())


def test_the_runs_of_another_study_are_an_error(tmp_path: Path) -> None:
    DICE.rows(DiceSettings(), tmp_path, Workers())
    (tmp_path / "runs/campaign.yaml").write_text(
        (tmp_path / "runs/campaign.yaml").read_text().replace("run: dice", "run: cards")
    )

    with pytest.raises(CampaignError, match="other settings"):
        DICE.rows(DiceSettings(), tmp_path, Workers())


@pytest.mark.parametrize("name", study_files())
def test_a_study_is_named_as_its_file_and_says_what_it_finds_out(name: str) -> None:
    study = find_study(name)

    assert study.name == name
    assert study.sentence.endswith(".")


@pytest.mark.parametrize("name", study_files())
def test_other_processes_can_import_what_a_run_needs(name: str) -> None:
    study = find_study(name)

    parts = study.axes, study.case, study.run, study.row
    assert study.row is None or pickle.loads(pickle.dumps(parts)) == parts  # noqa: S301


def test_a_name_without_a_file_is_an_error() -> None:
    with pytest.raises(UserError, match=r"no study 'lcca-chains'; there are: .*lcca-chain,"):
        find_study("lcca-chains")
