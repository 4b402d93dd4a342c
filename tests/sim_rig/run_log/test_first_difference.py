"""Where two runs of one scenario first decide otherwise, or at another time."""

from typing import Any

from sim_rig.run_log.first_difference import Decision, compare
from sim_rig.run_log.run_log import Record, RunLog

START_S = 50.0


def member(at_s: float, number: int = 2, **fields: object) -> Record:
    return _record(
        at_s, "transition", state="member", group_number=number, leader_id="aa", **fields
    )


def alarm(at_s: float, level: str = "warning") -> Record:
    return _record(at_s, "alarm", cause="fcw", level=level, vehicle="")


def brake(at_s: float, *, is_over: bool = False) -> Record:
    return _record(at_s, "hard_brake", deceleration_m_s2=5.0, is_over=is_over)


def _record(at_s: float, kind: str, **fields: Any) -> Record:
    return {"stamp_s": START_S + at_s, "kind": kind, **fields}


def log_of(**traces: list[Record]) -> RunLog:
    return RunLog(START_S, traces, [], {"aa": "green"})


def test_runs_with_the_same_decisions_have_no_difference() -> None:
    one = log_of(red=[member(1.0), brake(5.0), alarm(7.0)])
    other = log_of(red=[member(1.3), brake(5.1), alarm(7.05)])
    found = compare(one, other, within_s=0.5)
    assert (found.decisions, found.first) == (3, None)
    assert found.latest is not None
    assert found.latest.one == Decision(1.0, "red", "member 2 behind green")


def test_the_first_difference_is_the_earliest_of_all_cars() -> None:
    one = log_of(red=[member(1.0), alarm(7.0)], blue=[member(2.0, 3)])
    other = log_of(red=[member(1.0)], blue=[member(2.0, 2)])
    found = compare(one, other, within_s=0.5)
    assert found.first is not None
    assert found.first.at_s == 2.0
    assert (found.first.one, found.first.other) == (
        Decision(2.0, "blue", "member 3 behind green"),
        Decision(2.0, "blue", "member 2 behind green"),
    )
    assert found.decisions == 1


def test_a_decision_that_is_late_is_a_difference() -> None:
    found = compare(log_of(red=[alarm(7.0)]), log_of(red=[alarm(7.6)]), within_s=0.5)
    assert found.first is not None
    assert found.first.at_s == 7.0


def test_a_decision_that_one_run_lacks_is_a_difference() -> None:
    found = compare(log_of(red=[]), log_of(red=[alarm(7.5)]), within_s=0.5)
    assert found.first is not None
    assert (found.first.one, found.first.at_s) == (None, 7.5)


def test_an_alarm_that_one_run_lacks_does_not_hide_that_all_else_is_the_same() -> None:
    one = log_of(red=[alarm(0.5), member(1.0), brake(5.0)])
    other = log_of(red=[member(1.1), brake(5.1), member(6.0, 3)])
    found = compare(one, other, within_s=0.5)
    assert found.decisions == 2
    assert [(each.one, each.other) for each in found.differences] == [
        (Decision(0.5, "red", "alarm: fcw"), None),
        (None, Decision(6.0, "red", "member 3 behind green")),
    ]


def test_refreshes_cautions_ends_and_changes_of_braking_are_no_decisions() -> None:
    one = log_of(red=[member(1.0), brake(5.0), brake(6.0, is_over=True)])
    other = log_of(
        red=[
            member(1.0),
            member(1.5, cause="refresh"),
            alarm(2.0, "caution"),
            alarm(2.5, "none"),
            brake(5.0),
            brake(5.5),
            brake(6.0, is_over=True),
        ]
    )
    assert compare(one, other, within_s=0.5).first is None


def test_a_second_braking_is_another_decision() -> None:
    one = log_of(red=[brake(5.0), brake(6.0, is_over=True), brake(8.0)])
    assert compare(one, log_of(red=[brake(5.0)]), within_s=0.5).first is not None


def test_the_start_up_before_the_scenario_does_not_count() -> None:
    lost = _record(-1.0, "sensor_lost", sensor="speed")
    assert compare(log_of(red=[lost, alarm(1.0)]), log_of(red=[alarm(1.0)]), 0.5).first is None


def test_cars_that_only_one_run_traced_are_left_out() -> None:
    assert compare(log_of(red=[alarm(1.0)]), log_of(blue=[]), within_s=0.5).first is None
