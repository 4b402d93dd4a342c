"""The study of FCW while following, on a short recording."""

from pathlib import Path

import pytest

from onboard.errors import UserError
from sim_rig.studies.alarms.following_alarms_study import STUDY, FollowingSettings
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.catalogue import run_study
from tests.typed import every


def recording(folder: Path) -> Path:
    """Three cars at 20 m/s, 25 m from bumper to bumper, for 6 s, in OpenACC's format."""
    head = [
        "Date,8,10,2019",
        "Vehicle_order",
        "Number_of_vehicles,3",
        "ACC,1",
        "Distance_setting,S",
    ]
    columns = ["Time", "Speed1", "Speed2", "Speed3", "IVS1", "IVS2"]
    rows = [f"{k / 10},20,20,20,25,25" for k in range(61)]
    file = folder / "steady.csv"
    file.write_text("\n".join([*head, ",".join(columns), *rows, ""]), "utf-8")
    return file


@pytest.mark.long
def test_steady_following_raises_no_alarm_and_braking_does(tmp_path: Path) -> None:
    settings = FollowingSettings(
        files=(recording(tmp_path),), profiles=("radar-150",), brakings=3, gaps_m=(15.0, 18.0)
    )

    row = STUDY.one(settings, 0)

    assert row.hours == pytest.approx(2 * 6.0 / 3600.0)
    assert (row.false, row.true) == (0, 0)
    assert all(0.0 < delay_s < 1.0 for delay_s in every(float, row.delays_s))
    assert row == STUDY.one(settings, 0)


@pytest.mark.long
def test_the_table_has_a_line_for_each_profile(tmp_path: Path) -> None:
    given = {
        "files": [str(recording(tmp_path))],
        "profiles": ["radar-150", "camera-60"],
        "brakings": 1,
    }

    run_study("following-alarms", tmp_path / "out", None, Workers(1), given)

    lines = (tmp_path / "out/table.csv").read_text("utf-8").splitlines()
    assert [line.split(",")[0] for line in lines] == ["profile", "radar-150", "camera-60"]


def test_an_unknown_profile_is_named(tmp_path: Path) -> None:
    given = {"files": [str(recording(tmp_path))], "profiles": ["sonar"]}

    with pytest.raises(UserError, match="sonar"):
        run_study("following-alarms", tmp_path / "out", None, Workers(1), given)
