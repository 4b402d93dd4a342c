"""The verdict on a run of processes on the rig's computer: what excuses a failure, and what not."""

import os

import pytest

from sim_rig.reporting.verdict import Outcome, verdict
from sim_rig.run_log.daemon_lateness import STEP_LIMIT_S
from sim_rig.run_log.lateness import LIMITS_S, LatenessLine, lateness_line
from sim_rig.run_log.run_log import RunLog
from sim_rig.scenario.schema import Scenario, load_scenario


@pytest.fixture
def joins() -> Scenario:
    """It expects that red is a member at 6 s."""
    fig4 = load_scenario("fig4")
    return fig4.model_copy(update={"expect": fig4.expect[:1]})


def joined_at(at_s: float, *rig: LatenessLine, daemons: tuple[LatenessLine, ...] = ()) -> RunLog:
    joined = {"kind": "transition", "state": "member", "group_number": 2, "leader_id": "green"}
    trace = [joined | {"stamp_s": 100.0 + at_s}]
    return RunLog(100.0, {"red": trace}, [], {}, lateness=rig, daemon_lateness=daemons)


def punctual(what: str) -> LatenessLine:
    """Fewer than one output in a hundred are very late."""
    return lateness_line(what, [0.001] * 995 + [3.0] * 5, LIMITS_S[what])


def late(what: str) -> LatenessLine:
    """Two outputs in a hundred are a little late."""
    limit_s = LIMITS_S[what]
    return lateness_line(what, [0.001] * 98 + [1.1 * limit_s] * 2, limit_s)


def test_a_failure_in_a_punctual_run_fails_however_loaded_the_computer_is(
    joins: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "getloadavg", lambda: (99.0, 99.0, 99.0))
    log = joined_at(
        6.5, *map(punctual, LIMITS_S), daemons=(lateness_line("step", [0.01], STEP_LIMIT_S),)
    )

    found = verdict(joins, log)
    assert (found.outcome, found.invalid) == (Outcome.FAILED, ())


@pytest.mark.parametrize("what", LIMITS_S)
def test_a_failure_beside_a_late_end_of_a_wire_is_invalid(joins: Scenario, what: str) -> None:
    found = verdict(joins, joined_at(6.5, late(what)))

    assert found.outcome is Outcome.INVALID
    (why,) = found.invalid
    assert why.startswith(f"the rig was late: {what} p99")
    assert "2 of 100 missed" in why


@pytest.mark.parametrize(("what", "limit_s"), [("step", STEP_LIMIT_S), ("seen picture", 0.2)])
def test_a_failure_beside_late_daemons_is_invalid(
    joins: Scenario, what: str, limit_s: float
) -> None:
    line = lateness_line(what, [2 * limit_s], limit_s)

    found = verdict(joins, joined_at(6.5, daemons=(line,)))
    assert found.outcome is Outcome.INVALID
    (why,) = found.invalid
    assert why.startswith(f"the daemons were late: {what} p99 {2e3 * limit_s:.0f} ms, limit")


def test_what_is_met_in_spite_of_lateness_counts(joins: Scenario) -> None:
    daemons = (lateness_line("step", [1.0], STEP_LIMIT_S),)
    found = verdict(joins, joined_at(5.9, *map(late, LIMITS_S), daemons=daemons))

    assert (found.outcome, found.invalid, found.was_late) == (Outcome.PASSED, (), False)
