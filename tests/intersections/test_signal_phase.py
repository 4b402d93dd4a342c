"""Phases of a SPAT message and the time that is left of them."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import pytest

from onboard.errors import DecodeError
from onboard.intersections.signal_phase import SignalPhase, message_age_s, signal_phases
from onboard.messages.spat import IntersectionStatus, MovementPhaseState, MovementState
from tests.messages.crossing_messages import MOY_S, crossing_spat, movement

GREEN = MovementPhaseState.PROTECTED_MOVEMENT_ALLOWED
RED = MovementPhaseState.STOP_AND_REMAIN
SENT_UTC_S = datetime(2026, 1, 1, tzinfo=UTC).timestamp() + MOY_S + 12.3


def phases_of(
    *movements: MovementState, sent_utc_s: float = SENT_UTC_S, **parts: Any
) -> Mapping[int, SignalPhase]:
    (state,) = crossing_spat(*movements, **parts).intersections
    return signal_phases(state, sent_utc_s)


def reason_of(*movements: MovementState, **parts: IntersectionStatus) -> str:
    with pytest.raises(DecodeError) as refused:
        phases_of(*movements, **parts)
    return refused.value.reason


def test_the_time_left_counts_from_the_message() -> None:
    phases = phases_of()
    assert phases[2].state is GREEN
    assert phases[2].min_left_s == pytest.approx(7.7)
    assert phases[2].max_left_s == pytest.approx(12.7)
    assert phases[2].likely_left_s == pytest.approx(9.7)
    assert phases[4].state is RED
    assert (phases[4].max_left_s, phases[4].likely_left_s) == (None, None)


def test_a_time_mark_before_the_message_is_in_the_next_hour() -> None:
    before_the_hour = SENT_UTC_S - SENT_UTC_S % 3600.0 + 3595.0
    phases = phases_of(movement(2, GREEN, 4.0), sent_utc_s=before_the_hour)
    assert phases[2].min_left_s == pytest.approx(9.0)


@pytest.mark.parametrize("mark_s", [None, 3600.0])
def test_an_unknown_end_and_one_after_more_than_an_hour_leave_the_time_open(
    mark_s: float | None,
) -> None:
    assert phases_of(movement(2, RED, mark_s))[2].min_left_s is None


def test_a_phase_that_ended_just_before_the_message_has_no_time_left() -> None:
    assert phases_of(movement(2, GREEN, 12.0))[2].min_left_s == 0.0


def test_a_phase_that_ended_long_before_the_message_is_refused() -> None:
    assert reason_of(movement(2, GREEN, 2.0)) == "ends_in_past"


@pytest.mark.parametrize(
    "movements",
    [
        (movement(2, GREEN, 20.0), movement(2, RED, 20.0)),
        (movement(2, GREEN, 20.0, max_end_s=15.0),),
        (movement(2, GREEN, 20.0, max_end_s=30.0, likely_s=35.0),),
    ],
    ids=["two states of a group", "latest before earliest", "likely after latest"],
)
def test_contradictions_within_a_message_are_refused(movements: tuple[MovementState, ...]) -> None:
    assert reason_of(*movements) == "contradictory"


@pytest.mark.parametrize(
    "status",
    [
        IntersectionStatus.OFF,
        IntersectionStatus.FAILURE_FLASH,
        IntersectionStatus.NO_VALID_SPAT_IS_AVAILABLE_AT_THIS_TIME,
    ],
)
def test_signals_that_are_off_tell_nothing(status: IntersectionStatus) -> None:
    assert reason_of(status=status | IntersectionStatus.FIXED_TIME_OPERATION) == "dark"


def test_a_controller_without_a_map_of_its_own_has_phases() -> None:
    status = IntersectionStatus.NO_VALID_MAP_IS_AVAILABLE_AT_THIS_TIME
    assert phases_of(status=status)[2].state is GREEN


@pytest.mark.parametrize("state", [MovementPhaseState.DARK, MovementPhaseState.UNAVAILABLE])
def test_a_dark_signal_has_no_phase(state: MovementPhaseState) -> None:
    assert list(phases_of(movement(2, state, None), movement(4, RED, 20.0))) == [4]


def test_groups_that_name_no_signal_have_no_phase() -> None:
    unknown = [movement(0, RED, 20.0), movement(0, GREEN, 2.0), movement(255, RED, 20.0)]
    assert list(phases_of(*unknown, movement(4, RED, 20.0))) == [4]


def test_a_phase_runs_down_and_ends_with_its_latest_time() -> None:
    phase = SignalPhase(GREEN, 2.0, 5.0, 3.0)
    assert phase.after(2.5) == SignalPhase(GREEN, 0.0, 2.5, 0.5)
    assert phase.after(5.4) == SignalPhase(GREEN, 0.0, 0.0, 0.0)
    assert phase.after(5.6) is None
    assert SignalPhase(RED, 2.0, None, None).after(100.0) == SignalPhase(RED, 0.0, None, None)


def age_s(
    utc: float,
    *,
    moy_s: float | None = MOY_S,
    time_stamp_s: float | None = 12.3,
    minute_s: float | None = None,
) -> float | None:
    (state,) = crossing_spat(moy_s=moy_s, time_stamp_s=time_stamp_s).intersections
    return message_age_s(state, minute_s, utc)


def test_the_age_of_a_message_is_that_of_its_own_time() -> None:
    assert age_s(SENT_UTC_S + 0.4) == pytest.approx(0.4)
    assert age_s(SENT_UTC_S - 5.0) == pytest.approx(-5.0)


def test_a_message_of_the_last_moment_of_a_year_is_young_in_the_next() -> None:
    new_year = datetime(2025, 1, 1, tzinfo=UTC).timestamp()
    last_minute_s = 366 * 86_400.0 - 60.0
    assert age_s(new_year + 0.2, moy_s=last_minute_s, time_stamp_s=59.9) == pytest.approx(0.3)
    assert age_s(new_year - 0.1, moy_s=0.0, time_stamp_s=0.0) == pytest.approx(-0.1)


def test_a_leap_second_is_the_first_of_the_next_minute_which_utc_repeats() -> None:
    next_minute = SENT_UTC_S - 12.3 + 60.0
    assert age_s(next_minute, time_stamp_s=60.5) == pytest.approx(-0.5)


def test_the_minute_of_the_whole_message_stands_for_a_missing_one() -> None:
    assert age_s(SENT_UTC_S, moy_s=None, minute_s=MOY_S) == pytest.approx(0.0, abs=1e-3)
    assert age_s(SENT_UTC_S, moy_s=None) is None
    assert age_s(SENT_UTC_S, time_stamp_s=None) is None
