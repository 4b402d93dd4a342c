"""How late daemons were, by their traces and the rig's."""

import pytest

from sim_rig.run_log.daemon_lateness import STEP_LIMIT_S, daemon_lateness
from sim_rig.run_log.lateness import LatenessLine
from sim_rig.run_log.run_log import Record, RunLog

START_S = 100.0
PICTURES_S = 0.1


def answer(at_s: float, car: str = "red") -> Record:
    return {"stamp_s": START_S + at_s, "kind": "ecu_answer", "car": car, "speed_km_h": 50}


def traced(kind: str, at_s: float, late_s: float) -> Record:
    return {"stamp_s": START_S + at_s, "kind": kind, "traced_s": START_S + at_s + late_s}


def lines(*trace: Record, rig: tuple[Record, ...] = (), daemons: str = "red") -> list[LatenessLine]:
    log = RunLog(START_S, {"red": trace}, rig, {})
    return list(daemon_lateness(log, daemons.split(), PICTURES_S))


def test_a_step_is_late_from_the_answer_on_the_bus_to_the_trace() -> None:
    rig = (answer(1.0), answer(1.05, "green"), answer(1.1))
    reads_late, steps_late = traced("speed", 1.08, 0.001), traced("speed", 1.101, 0.2)

    (line,) = lines(reads_late, steps_late, rig=rig)
    assert (line.what, line.n, line.limit_s) == ("step", 2, STEP_LIMIT_S)
    assert line.p50_s == pytest.approx((0.081 + 0.201) / 2)
    assert line.misses == 1
    assert line.is_too_late


def test_a_seen_picture_may_be_two_intervals_late() -> None:
    (punctual,) = lines(traced("lead", 1.0, 0.19), traced("lead", 1.1, 0.05))
    (late,) = lines(traced("lead", 1.0, 0.21), traced("lead", 1.1, 0.05))

    assert punctual.what == "seen picture"
    assert not punctual.is_too_late
    assert late.is_too_late


def test_what_was_before_the_start_is_not_asked() -> None:
    assert lines(traced("lead", -1.0, 3.0)) == []


def test_a_car_that_is_no_daemon_or_is_slowed_by_a_fault_is_not_asked() -> None:
    assert lines(traced("lead", 1.0, 3.0), daemons="") == []


def test_a_speed_before_any_answer_is_not_asked() -> None:
    assert lines(traced("speed", 1.0, 0.5), rig=(answer(2.0),)) == []
