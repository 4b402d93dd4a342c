"""The study of IMA alarms, with a few approaches."""

import csv
from pathlib import Path

import pytest

from sim_rig.studies import crossing_alarms
from sim_rig.studies.crossing_alarms import AlarmSettings, run


def test_crashes_raise_alarms_and_harmless_approaches_do_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(crossing_alarms, "PAIRS", ())

    summary = run(tmp_path, AlarmSettings(approaches=10, seed=4))

    assert summary.startswith("approaches: ")
    with (tmp_path / "table.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert int(row["n"]) >= 1
    assert int(row["missed"]) == 0
    assert float(row["lead_5_percent_s"]) > 0.8
    assert int(row["false_alarms"]) == 0
    assert (tmp_path / "settings.yaml").exists()
