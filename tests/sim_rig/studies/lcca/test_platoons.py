"""Followers of a recorded platoon are counted while they should be members."""

from pathlib import Path

import pytest

from sim_rig.run_log.run_log import RunLog
from sim_rig.scenario.schema import Scenario
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.lcca.platoons_study import STUDY, PlatoonSettings, follower_times, scenario_of

ROWS = "".join(
    f"{step / 10},car1,{30 + step},10\n{step / 10},car2,{10.5 + step},10\n" for step in range(61)
)
"""Two cars at 10 m/s with a gap of 15 m for 6 s."""


@pytest.fixture
def settings(tmp_path: Path) -> PlatoonSettings:
    path = tmp_path / "platoon.csv"
    path.write_text("t,id,x,v\n" + ROWS)
    return PlatoonSettings(files=(path,))


def scenario(settings: PlatoonSettings) -> Scenario:
    return scenario_of(settings, settings.files[0], 1)


def test_due_is_who_is_inside_the_safety_distance(settings: PlatoonSettings) -> None:
    it = scenario(settings)
    records = [
        {"stamp_s": 2.0, "kind": "transition", "state": "member"},
        {"stamp_s": 4.0, "kind": "transition", "state": "regular"},
        {"stamp_s": 5.0, "kind": "transition", "state": "member"},
    ]
    log = RunLog(0.0, {"car1": [], "car2": records}, [], {})

    count = follower_times(it, log, up_to_m=25.0)["car2"]
    assert (count.due_s, count.member_s) == pytest.approx((6.0, 3.0), abs=0.11)
    assert count.joins == 2
    assert follower_times(it, log, up_to_m=14.0)["car2"].due_s == 0.0


def test_a_follower_of_a_recorded_car_becomes_a_member(settings: PlatoonSettings) -> None:
    row = STUDY.one(settings, 0)

    assert row.followers == 1
    assert row.joins == 1
    assert row.member_s / row.due_s > 0.8


def test_the_study_writes_a_line_for_each_recording(
    settings: PlatoonSettings, tmp_path: Path
) -> None:
    summary = STUDY.write(tmp_path / "out", settings, Workers())

    assert summary.startswith("members ")
    lines = (tmp_path / "out" / "table.csv").read_text().splitlines()
    assert len(lines) == 2
    assert lines[1].startswith("platoon,1,")
