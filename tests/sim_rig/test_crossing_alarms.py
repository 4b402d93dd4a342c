"""The study of alarms: a few approaches, of which the harmful ones are warned of in time."""

import csv
from pathlib import Path

import pytest

from sim_rig.studies import crossing_alarms
from sim_rig.studies.crossing_alarms import AlarmSettings, run


def test_crashes_are_warned_of_and_harmless_approaches_are_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(crossing_alarms, "PAIRS", ())

    told = run(tmp_path, AlarmSettings(approaches=10, seed=4))

    assert told.startswith("approaches: ")
    with (tmp_path / "table.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert int(row["n"]) >= 1
    assert int(row["missed"]) == 0
    assert float(row["lead_5_percent_s"]) > 0.8
    assert int(row["false_alarms"]) == 0
    assert (tmp_path / "settings.yaml").exists()
