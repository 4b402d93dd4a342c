"""The study of false identities, in a small campaign."""

import csv
from pathlib import Path

import numpy as np
import pytest

from onboard.lcca.identification import Identification
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.catalogue import run_study
from sim_rig.studies.lcca import false_identity_study
from sim_rig.studies.lcca.false_identity_study import STUDY, FalseIdentitySettings, Insider

SMALL = FalseIdentitySettings(runs=1, vehicles=30, fleet=10, seconds=2.0, radios=(1.0,))


def test_cars_ahead_are_identified_and_no_other_ones() -> None:
    row = STUDY.one(SMALL, 0)

    assert row.with_radio == 10
    assert len(row.identified_s) >= 7
    assert row.wrong_long == 0


def test_an_insider_with_another_speed_is_not_taken_for_the_lead() -> None:
    settings = SMALL.model_copy(update={"insiders": (Insider.OWN_SPEED,), "stream": 0.2})

    assert STUDY.one(settings, 0).wrong_long <= 1


def test_a_run_is_the_same_every_time() -> None:
    assert STUDY.one(SMALL, 0) == STUDY.one(SMALL, 0)


@pytest.mark.long
def test_the_table_is_written(tmp_path: Path) -> None:
    given = {"runs": 1, "vehicles": 20, "seconds": 2.0, "radios": [0.5], "fleet": 5}

    summary = run_study("false-identity", tmp_path, None, Workers(), given)

    with (tmp_path / "table.csv").open() as file:
        (line,) = csv.DictReader(file)
    assert line["changes"] == "10"
    assert "0 of 10 vehicles ahead" in summary


def test_a_host_knows_its_speed_by_its_speedometer(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was given its true speed, some 20 m/s, while all others sent what theirs show."""
    monkeypatch.setattr(false_identity_study, "SPEEDOMETER", (2.0, 0.0))
    received_m_s: list[float] = []
    monkeypatch.setattr(
        Identification, "receive_speed", lambda _, speed_m_s, _now: received_m_s.append(speed_m_s)
    )

    STUDY.one(SMALL, 0)

    assert 30.0 < np.mean(received_m_s) < 50.0
