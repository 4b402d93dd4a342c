"""The study of leads on sparse roads, in a small campaign, and its road."""

import csv
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from onboard.lcca.identification import Identification
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.catalogue import run_study
from sim_rig.studies.lcca import sparse_leads_study
from sim_rig.studies.lcca.sparse_leads_study import STUDY, SparseLeadsSettings
from sim_rig.studies.lcca.sparse_road import LANE_M, ONCOMING, OWN, SparseRoad

SMALL = SparseLeadsSettings(
    runs=1,
    hosts=2,
    vehicles=(8,),
    radios=(1.0,),
    legible=(1.0,),
    plate_px=(50.0, 60.0),
    seconds=10.0,
)


def test_leads_with_radio_and_plate_are_identified() -> None:
    row = STUDY.one(SMALL, 0)

    assert row.leads == row.with_radio == len(row.identified_s) == 1
    assert row.wrong == 0


def test_without_radios_nobody_is_taken_for_the_lead() -> None:
    row = STUDY.one(SMALL.model_copy(update={"radios": (0.0,)}), 0)

    assert row.with_radio == row.wrong == len(row.identified_s) == 0


def test_a_run_is_the_same_every_time() -> None:
    settings = SMALL.model_copy(update={"positions": (True,), "seconds": 2.0})

    assert STUDY.one(settings, 0) == STUDY.one(settings, 0)


def test_the_table_is_written(tmp_path: Path) -> None:
    given = {
        "runs": 1, "vehicles": [4, 8], "radios": [0.5], "legible": [0.0], "seconds": 2.0,
    }  # fmt: skip

    summary = run_study("sparse-leads", tmp_path, None, Workers(), given)

    with (tmp_path / "table.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert [line["vehicles"] for line in lines] == ["4", "8"]
    assert summary.startswith("0 of ")


def test_cars_of_a_lane_follow_each_other_and_never_touch() -> None:
    road = SparseRoad(24, 25.0, np.random.default_rng(1))
    for _ in range(600):
        road.advance(0.1)
        assert road.gaps_m.min() > 0.0
    for lane in range(3):
        speeds_m_s = road.speeds_m_s[road.lanes == lane]
        assert all(abs(after - before) < 3.0 for before, after in pairwise(speeds_m_s))


def test_offsets_are_those_of_the_host_s_lane() -> None:
    road = SparseRoad(12, 25.0, np.random.default_rng(1))
    (ahead_m, right_m), *_ = road.offsets_m(1).tolist()
    assert ahead_m > 0.0
    assert right_m == 0.0
    rights_m = road.offsets_m(1)[road.lanes == ONCOMING][:, 1]
    assert (rights_m == -2.0 * LANE_M).all()
    assert road.lanes[1] == OWN


def test_a_host_knows_its_speed_by_its_speedometer(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was given its true speed, while all others sent what theirs show."""
    monkeypatch.setattr(sparse_leads_study, "SPEEDOMETER", (1.1, 0.0))
    received_m_s: list[float] = []
    monkeypatch.setattr(
        Identification, "receive_speed", lambda _, speed_m_s, _now: received_m_s.append(speed_m_s)
    )

    STUDY.one(SMALL.model_copy(update={"speed_m_s": (20.0, 20.0), "seconds": 2.0}), 0)

    assert 21.0 < np.mean(received_m_s) < 23.0
