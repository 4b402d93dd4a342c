"""The study of alarms at crossings, with a few meetings of each kind."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from sim_rig.studies.alarms import crossing_alarms_study
from sim_rig.studies.alarms.crossing_alarms_study import (
    ROLES,
    SPEED_AGE_S,
    STUDY,
    AlarmSettings,
    yaw_rate,
)
from sim_rig.studies.alarms.crossing_meetings import TICK_S, Meeting, MeetingKind, meetings
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.joerer.traffic import TrafficSettings

FEW = AlarmSettings(runs=1, seed=4, traffic=TrafficSettings(approaches=4))


def some(kind: MeetingKind, ignoring: float, n: int = 40) -> list[Meeting]:
    traffic = TrafficSettings(approaches=n, ignoring=ignoring)
    return list(meetings(kind, traffic, np.random.default_rng(3)))


@pytest.mark.parametrize("kind", MeetingKind)
def test_vehicles_touch_only_where_the_second_does_not_yield(kind: MeetingKind) -> None:
    yielding, ignoring = some(kind, 0.0), some(kind, 1.0)

    assert all(math.isinf(each.contact_s) for each in yielding)
    assert all(each.gap_s > 0.0 for each in yielding)
    assert any(math.isfinite(each.contact_s) for each in ignoring)
    assert all(each.gap_s <= 0.0 for each in ignoring if math.isfinite(each.contact_s))


@pytest.mark.parametrize("kind", MeetingKind)
def test_positions_move_with_speed_and_course(kind: MeetingKind) -> None:
    for each in some(kind, 0.5, 5):
        moved_m = np.diff(each.position_m, axis=0)
        ahead = np.stack([np.cos(each.course_rad), np.sin(each.course_rad)], axis=-1)
        expected_m = each.speed_m_s[1:, :, None] * ahead[1:] * TICK_S

        assert moved_m == pytest.approx(expected_m, abs=0.02)


def test_who_pulls_out_has_stood_and_who_turns_left_ends_at_a_right_angle() -> None:
    assert all(each.speed_m_s[0, 1] == 0.0 for each in some(MeetingKind.PULL_OUT, 0.5))
    turned = [each for each in some(MeetingKind.LEFT_TURN, 0.0) if each.speed_m_s[-1, 1] > 1.0]
    assert turned
    assert max(each.course_rad[-1, 1] for each in turned) == pytest.approx(math.pi / 2)


def test_the_bus_reports_the_yaw_rate_of_the_turn() -> None:
    """It was twice the true one."""
    turned = next(each for each in some(MeetingKind.LEFT_TURN, 0.0) if each.course_rad[-1, 1] > 1.5)
    ticks = np.flatnonzero((turned.course_rad[:, 1] > 0.3) & (turned.course_rad[:, 1] < 1.2))
    late = round(SPEED_AGE_S / TICK_S)
    slope_rad_s = np.gradient(turned.course_rad[:, 1], TICK_S)

    for tick in ticks[::5]:
        reported = yaw_rate(turned, int(tick), 1, noise_rad_s=0.0)
        assert -reported.yaw_rate_rad_s == pytest.approx(slope_rad_s[tick - late], rel=0.02)


def test_several_warnings_of_one_meeting_are_one_nuisance(monkeypatch: pytest.MonkeyPatch) -> None:
    """They have one cause, while the bound of nuisances takes these as independent."""
    monkeypatch.setattr(crossing_alarms_study, "_warned_s", lambda *_: iter([1.0, 2.0, 3.0]))
    traffic = TrafficSettings(approaches=4, ignoring=0.0)

    row = STUDY.one(FEW.model_copy(update={"traffic": traffic}), 0)

    for counts in row.roles.values():
        assert counts.nuisances + counts.near_misses == 4


@pytest.mark.long
def test_a_run_judges_both_drivers_and_is_the_same_every_time() -> None:
    row = STUDY.one(FEW, 0)

    assert row == STUDY.one(FEW, 0)
    assert set(row.roles) == set(ROLES)
    assert all(each.hours > 0.0 for each in row.roles.values())


@pytest.mark.long
def test_the_table_has_a_line_for_each_kind_and_role(tmp_path: Path) -> None:
    summary = STUDY.write(tmp_path, FEW, Workers())

    assert summary.startswith("straight, right of way: ")
    with (tmp_path / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(MeetingKind) * len(ROLES)
    assert all(float(row["per_100_h_at_most"]) > float(row["per_100_h"]) for row in rows)
