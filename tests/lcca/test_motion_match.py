"""Which of the vehicles on the air moves as the lead does."""

import math

import numpy as np
import pytest

from onboard.lcca.motion_match import (
    MAX_EVIDENCE,
    MAX_VEHICLES,
    MIN_EVIDENCE,
    SILENT_S,
    MotionMatch,
)

AHEAD, OTHER = b"ahead", b"other"
OWN_M_S = 20.0


def speed_ahead(at_s: float) -> float:
    """Return a speed that varies as in dense traffic."""
    return OWN_M_S + 2.0 * math.sin(at_s / 3.0)


def drive(
    match: MotionMatch,
    until_s: float,
    *,
    from_s: float = 0.0,
    delay_s: float = 0.0,
    offset_m_s: float = 0.0,
    other_m_s: float = OWN_M_S,
    wrong_by_m_s: float = 0.0,
) -> None:
    """Let the lead and one at a constant speed send at 10 Hz.

    The own speedometer is `wrong_by_m_s` too high.
    """
    rng = np.random.default_rng(3)
    for step in range(round(from_s * 10), round(until_s * 10)):
        now = step / 10
        match.receive_speed_on_air(AHEAD, speed_ahead(now) + offset_m_s, now)
        match.receive_speed_on_air(OTHER, other_m_s, now)
        seen_m_s = speed_ahead(now - delay_s) + float(rng.normal(0.0, 0.2)) + wrong_by_m_s
        match.receive_lead_speed(seen_m_s, 0.2, OWN_M_S + wrong_by_m_s, now)


def test_a_vehicle_that_is_not_heard_has_no_evidence() -> None:
    assert MotionMatch().log_ratio(AHEAD) == 0.0


@pytest.mark.parametrize("delay_s", [0.0, 0.2, 0.4, 0.6])
@pytest.mark.parametrize("offset_m_s", [-0.4, 0.0, 0.4])
def test_the_lead_is_found_by_its_changes_of_speed(delay_s: float, offset_m_s: float) -> None:
    match = MotionMatch()
    drive(match, 15.0, delay_s=delay_s, offset_m_s=offset_m_s)
    assert match.log_ratio(AHEAD) > 5.0
    assert match.log_ratio(OTHER) < -5.0


@pytest.mark.parametrize(("lag_s", "is_lead"), [(0.2, True), (1.6, False), (-1.6, False)])
def test_a_vehicle_that_moves_so_at_another_time_is_another_one_of_the_row(
    lag_s: float, is_lead: bool
) -> None:
    match, rng = MotionMatch(), np.random.default_rng(4)
    for step in range(300):
        now = step / 10
        match.receive_speed_on_air(AHEAD, speed_ahead(now), now)
        seen_m_s = speed_ahead(now - lag_s) + float(rng.normal(0.0, 0.2))
        match.receive_lead_speed(seen_m_s, 0.2, OWN_M_S, now)
    difference = match.log_ratio(AHEAD) - match.in_row_log_ratios()[AHEAD]
    assert difference > 3.0 if is_lead else difference < -3.0


def test_another_speed_is_evidence_at_once() -> None:
    match = MotionMatch()
    drive(match, 0.5, other_m_s=OWN_M_S + 8.0)
    assert match.log_ratio(OTHER) < -10.0
    assert match.log_ratio(AHEAD) > 0.5


def test_a_much_slower_lead_does_not_decline_after_the_first_sample() -> None:
    match = MotionMatch()
    for step in range(30):
        now = step / 10
        match.receive_speed_on_air(AHEAD, OWN_M_S, now)
        match.receive_lead_speed(OWN_M_S, 0.2, OWN_M_S + 20.0, now)
    assert match.decline(AHEAD) > -1.0
    assert MAX_EVIDENCE - 0.5 < match.log_ratio(AHEAD) <= MAX_EVIDENCE


def test_at_constant_speeds_equal_speeds_decide_nothing() -> None:
    match = MotionMatch()
    for step in range(600):
        now = step / 10
        match.receive_speed_on_air(OTHER, OWN_M_S, now)
        match.receive_lead_speed(OWN_M_S, 0.2, OWN_M_S, now)
    assert 0.0 < match.log_ratio(OTHER) < 8.0  # 17 are needed among 200 vehicles


def test_one_wrong_speed_decides_nothing() -> None:
    match = MotionMatch()
    drive(match, 15.0)
    before = match.log_ratio(AHEAD)
    match.receive_lead_speed(0.0, 0.2, OWN_M_S, 15.4)
    assert before - match.log_ratio(AHEAD) <= 3.0 + 1e-9


def test_the_decline_begins_when_the_lead_moves_otherwise() -> None:
    match = MotionMatch()
    drive(match, 30.0)
    assert match.decline(AHEAD) > -3.0
    for step in range(300, 340):
        now = step / 10
        match.receive_speed_on_air(AHEAD, speed_ahead(now), now)
        match.receive_lead_speed(OWN_M_S - 6.0, 0.2, OWN_M_S, now)
    assert match.decline(AHEAD) < -7.0


@pytest.mark.parametrize("wrong_by_m_s", [15.0, -10.0])
def test_after_an_impossible_jump_of_the_own_speed_all_vehicles_begin_anew(
    wrong_by_m_s: float,
) -> None:
    """The own speedometer is wrong for ten seconds; then the lead may be it again."""
    match = MotionMatch()
    drive(match, 15.0, other_m_s=12.0)

    drive(match, 25.0, from_s=15.0, other_m_s=12.0, wrong_by_m_s=wrong_by_m_s)
    wrong = match.log_ratio(AHEAD)
    drive(match, 26.0, from_s=25.0, other_m_s=12.0)

    assert wrong < -7.0
    assert match.log_ratio(AHEAD) > 0.0
    assert match.log_ratio(OTHER) < -7.0


def test_one_wrong_own_speed_does_not_begin_anew() -> None:
    match = MotionMatch()
    drive(match, 15.0)

    drive(match, 15.1, from_s=15.0, wrong_by_m_s=15.0)
    drive(match, 16.0, from_s=15.1)

    assert match.log_ratio(AHEAD) > 3.0
    assert match.log_ratio(OTHER) < -5.0


def test_a_restart_keeps_the_speeds_and_drops_the_evidence() -> None:
    match = MotionMatch()
    drive(match, 15.0)
    match.restart()
    assert match.log_ratio(AHEAD) == match.decline(AHEAD) == 0.0
    assert match.is_on_air(AHEAD)


def test_the_evidence_is_bounded() -> None:
    match = MotionMatch()
    drive(match, 200.0, other_m_s=60.0)
    assert match.log_ratio(AHEAD) <= MAX_EVIDENCE
    assert match.log_ratio(OTHER) >= MIN_EVIDENCE


def test_silent_vehicles_are_forgotten_and_their_number_is_bounded() -> None:
    match = MotionMatch()
    for number in range(2 * MAX_VEHICLES):
        match.receive_speed_on_air(number.to_bytes(4), 20.0, 0.001 * number)
    assert len(match) == MAX_VEHICLES
    match.receive_speed_on_air(AHEAD, 20.0, 2.0 + SILENT_S)
    assert len(match) == 1
