"""The public test procedures: what happens in them, and some of them warned of."""

import math
from itertools import chain
from pathlib import Path

import pytest

from onboard.errors import UserError
from onboard.kinematics.units import KM_H
from sim_rig.roads.recording import STEP_S, Trajectory
from sim_rig.studies.alarms.procedures import (
    LANE_M,
    MEETS_S,
    PROCEDURES,
    Procedure,
    ProcedureName,
)
from sim_rig.studies.alarms.procedures_study import STUDY, ProceduresSettings
from sim_rig.studies.alarms.wired_vehicle import LENGTH_M
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.catalogue import run_study

ALL = list(chain.from_iterable(PROCEDURES.values()))


def of(group: ProcedureName, case: str) -> Procedure:
    return next(each for each in PROCEDURES[group] if each.case == case)


def at(drive: Trajectory, at_s: float) -> tuple[float, float]:
    x_m, y_m = drive.middle_m[round(at_s / STEP_S)]
    return float(x_m), float(y_m)


@pytest.mark.parametrize("procedure", ALL, ids=lambda each: f"{each.group} {each.case}")
def test_every_case_ends_in_a_contact_that_a_warning_can_precede(procedure: Procedure) -> None:
    assert MEETS_S - 1.5 < procedure.contact_s < MEETS_S + 4.0
    assert 1.0 < procedure.asked_s < 2.5


def test_a_braking_driver_needs_the_time_of_the_reaction_and_half_of_the_braking() -> None:
    standing = of(ProcedureName.FMVSS_127, "80/0 km/h")

    assert standing.asked_s == pytest.approx(1.0 + 80 * KM_H / 8.0 / 2.0, abs=0.03)


def test_who_is_ahead_is_as_far_ahead_as_the_procedure_says_until_it_brakes() -> None:
    case = of(ProcedureName.NHTSA_FCW, "72 km/h, 30 m, 2.9 m/s2")
    host, lead = case.host.trajectory("host"), case.other.trajectory("other")

    for at_s in (0.0, 4.9):
        gap_m = at(lead, at_s)[1] - at(host, at_s)[1] - LENGTH_M
        assert gap_m == pytest.approx(30.0, abs=0.2)


def test_who_turns_left_ends_westwards_and_meets_the_oncoming_car_in_its_lane() -> None:
    turn = of(ProcedureName.CCFTAP, "15/45 km/h")
    host = turn.host.trajectory("host")

    assert host.heading_rad[0] == pytest.approx(math.pi / 2.0)
    assert host.heading_rad[-1] == pytest.approx(math.pi, abs=0.02)
    assert at(turn.other.trajectory("other"), MEETS_S)[0] == pytest.approx(-LANE_M)
    assert turn.signals_left


def test_positions_move_with_speed_and_course() -> None:
    for each in ALL:
        drive = each.host.trajectory("host")
        for step in range(60, 75):
            east_m, north_m = drive.middle_m[step + 1] - drive.middle_m[step]
            mean_m_s = (drive.speed_m_s[step + 1] + drive.speed_m_s[step]) / 2.0
            assert math.hypot(east_m, north_m) == pytest.approx(mean_m_s * STEP_S, abs=0.02)


def test_an_unknown_profile_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="sonar"):
        run_study("procedures", tmp_path / "out", None, Workers(1), {"profiles": ["sonar"]})


def test_a_standing_car_is_warned_of_by_radar_and_the_run_is_the_same_every_time() -> None:
    settings = ProceduresSettings(procedures=(ProcedureName.CCRS,), profiles=("radar-150",))

    row = STUDY.one(settings, 0)

    assert row.cause == "fcw"
    assert row.lead_s is not None
    assert row.lead_s >= row.asked_s
    assert row == STUDY.one(settings, 0)


@pytest.mark.long
def test_without_a_sensor_only_the_other_cars_messages_tell_of_it() -> None:
    """Both at 20 km/h, where drivers could stop in a few metres."""
    heard = ProceduresSettings(procedures=(ProcedureName.CCCSCP,), profiles=("bsm",))
    unseen = heard.model_copy(update={"profiles": ("plate-camera",)})

    row = STUDY.one(heard, 0)
    assert row.cause == "ima"
    assert row.lead_s is not None
    assert row.lead_s >= row.asked_s
    assert STUDY.one(unseen, 0).cause == ""


@pytest.mark.long
def test_a_car_that_crosses_is_in_view_of_corner_radars() -> None:
    crossing = ProceduresSettings(
        procedures=(ProcedureName.CCCSCP,), profiles=("corner-radar-80",), runs=1
    )

    row = STUDY.one(crossing, 0)

    assert row.cause == "ima"
    assert row.lead_s is not None
    assert row.lead_s >= row.asked_s


@pytest.mark.long
@pytest.mark.parametrize("number", [1, 2])
def test_a_car_that_comes_towards_a_slow_left_turn_stays_in_its_lane_by_radar(number: int) -> None:
    """By courses alone, the heading is late in the turn, and the other car seems to come aside."""
    turns = ProceduresSettings(
        seed=5, procedures=(ProcedureName.CCFTAP,), profiles=("radar-150",), runs=2
    )

    row = STUDY.one(turns, 9 + number)

    assert row.lead_s is not None
    assert row.lead_s >= row.asked_s


@pytest.mark.long
def test_a_left_turn_is_known_as_it_begins() -> None:
    turns = ProceduresSettings(procedures=(ProcedureName.CCFTAP,), profiles=("bsm",), runs=1)

    row = STUDY.one(turns, len(PROCEDURES[ProcedureName.CCFTAP]) - 1)

    assert row.cause == "lta"
    assert row.lead_s is not None
    assert row.lead_s >= row.asked_s


@pytest.mark.long
def test_the_table_has_a_line_for_each_case_and_profile(tmp_path: Path) -> None:
    given = {"procedures": ["CCRs"], "profiles": ["bsm", "radar-150"], "runs": 1}

    run_study("procedures", tmp_path / "out", None, Workers(1), given)

    lines = (tmp_path / "out/table.csv").read_text("utf-8").splitlines()
    assert len(lines) == 1 + 2 * len(PROCEDURES[ProcedureName.CCRS])
