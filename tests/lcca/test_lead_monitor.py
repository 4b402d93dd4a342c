"""Whether the lead is to be joined: identity, headway, speed."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.lcca.events import MeasuredLead
from onboard.lcca.lead_monitor import LeadMonitor
from onboard.lcca.parameters import GroupParameters
from onboard.lcca.settings import LccaSettings
from onboard.sensors.host_state import SPEED_VALID_S
from onboard.settings import SettingsError, parse_settings

A, B = b"car-aaaa", b"car-bbbb"


def lead_monitor(speed_m_s: float = 20.0, **changes: float) -> LeadMonitor:
    monitor = LeadMonitor(GroupParameters(**changes))  # type: ignore[arg-type]
    monitor.receive_speed(speed_m_s, 0.0)
    return monitor


@given(st.floats(1.0, 200.0))
def test_the_safety_distance_is_0_55_m_for_each_km_h(speed_km_h: float) -> None:
    monitor = lead_monitor(speed_km_h / 3.6)
    monitor.receive_lead(MeasuredLead(A, 0.55 * speed_km_h * 0.999, 0.0), 0.0)
    assert monitor.lead_to_join(0.0) == A
    monitor.receive_lead(MeasuredLead(A, 0.55 * speed_km_h * 1.001, 0.0), 0.0)
    assert monitor.lead_to_join(0.0) is None


def test_at_standstill_no_gap_is_too_small() -> None:
    monitor = lead_monitor(0.0)
    monitor.receive_lead(MeasuredLead(A, 0.5, 0.0), 0.0)
    assert monitor.lead_to_join(0.0) is None


def test_between_the_two_headways_nothing_is_joined_and_nothing_left() -> None:
    monitor = lead_monitor(20.0)
    monitor.receive_lead(MeasuredLead(A, 2.1 * 20.0, 0.0), 0.5)
    assert monitor.lead_to_join(0.5) is None
    assert monitor.close_at(A) == 0.5
    monitor.receive_lead(MeasuredLead(A, 2.2 * 20.0, 0.0), 0.6)
    assert monitor.close_at(A) == 0.5


def test_without_a_recent_speed_no_gap_is_too_small() -> None:
    monitor = lead_monitor()
    monitor.receive_lead(MeasuredLead(A, 10.0, 0.0), SPEED_VALID_S)
    assert monitor.lead_to_join(SPEED_VALID_S) is None
    assert monitor.speed_at(SPEED_VALID_S) is None
    assert monitor.close_at(A) < 0.0


def test_a_vehicle_without_known_plate_is_not_joined() -> None:
    monitor = lead_monitor()
    monitor.receive_lead(MeasuredLead(None, 10.0, 0.0), 0.0)
    assert monitor.lead_to_join(0.0) is None


def test_a_frame_without_a_vehicle_clears_the_identity() -> None:
    monitor = lead_monitor()
    monitor.receive_lead(MeasuredLead(A, 20.0, 0.0), 0.0)
    monitor.receive_lead(None, 0.1)
    assert monitor.identified is None
    assert monitor.lead_to_join(0.1) is None


def test_a_frame_that_may_hide_a_vehicle_keeps_the_identity_but_shows_none() -> None:
    monitor = lead_monitor()
    monitor.receive_lead(MeasuredLead(A, 20.0, 0.0), 0.0)
    monitor.receive_lead(None, 0.1, is_unknown=True)
    assert monitor.identified == A
    assert monitor.lead_to_join(0.1) is None
    assert not monitor.shows_close(A)


def test_who_stands_near_the_lead_stays_close_to_it() -> None:
    monitor = lead_monitor(0.0)
    monitor.receive_lead(MeasuredLead(A, 9.9, 0.0), 0.1)
    assert (monitor.close_at(A), monitor.is_far(A)) == (0.1, False)
    monitor.receive_lead(MeasuredLead(A, 10.1, 0.0), 0.2)
    assert (monitor.close_at(A), monitor.is_far(A)) == (0.1, True)


@pytest.mark.parametrize(
    ("last_gap_m", "speed_m_s", "ahead_m_s", "lead", "held_until_s"),
    [
        (4.9, 0.0, None, None, 20.0),
        (4.9, 2.0, None, None, 2.5),  # until it has driven 5 m
        (4.9, 2.0, 2.0, None, 20.0),  # or both have
        (4.9, 2.0, 1.0, None, 5.0),
        (4.9, 1.0, 2.0, None, 5.0),  # who is farther ahead by now would be seen
        (4.9, 3.1, 3.1, None, 0.0),
        (5.1, 0.0, None, None, 0.0),
        (4.9, 0.0, None, MeasuredLead(None, 6.0, 0.0), 20.0),  # at rest nobody is asked
        (4.9, 0.0, None, MeasuredLead(None, 11.0, 0.0), 0.0),
        (4.9, 0.0, None, MeasuredLead(B, 6.0, 0.0), 0.0),
    ],
)
def test_a_lead_too_near_for_the_camera_is_there_while_the_host_crawls(
    last_gap_m: float,
    speed_m_s: float,
    ahead_m_s: float | None,
    lead: MeasuredLead | None,
    held_until_s: float,
) -> None:
    monitor = lead_monitor(speed_m_s)
    monitor.receive_lead(MeasuredLead(A, last_gap_m, 0.0), 0.0)
    close_at = monitor.close_at(A)
    for frame in range(1, 201):
        monitor.receive_speed_on_air(A, ahead_m_s, frame / 10 - 0.1)
        monitor.receive_speed(speed_m_s, frame / 10)
        monitor.receive_lead(lead, frame / 10)
        close_at = max(close_at, monitor.close_at(A))
    assert close_at == pytest.approx(held_until_s, abs=0.11)


@pytest.mark.parametrize(
    ("speed_m_s", "matches"),
    [(17.0, True), (21.9, True), (22.1, False), (11.9, False), (None, True)],
)
def test_the_speed_in_a_reply_must_match_the_camera(speed_m_s: float | None, matches: bool) -> None:
    monitor = lead_monitor(20.0, speed_tolerance_m_s=5.0)
    # Closing at 3 m/s: the lead drives 17 m/s.
    monitor.receive_lead(MeasuredLead(A, 20.0, 3.0), 0.0)
    assert monitor.matches_speed(speed_m_s, 0.0) is matches


def test_without_a_closing_speed_any_reply_matches() -> None:
    monitor = lead_monitor(20.0)
    monitor.receive_lead(MeasuredLead(A, 20.0, None), 0.0)
    assert monitor.matches_speed(99.0, 0.0)


def test_a_leave_headway_below_the_join_headway_is_an_error() -> None:
    with pytest.raises(SettingsError, match=r"leave_headway_s must not be below join_headway_s"):
        parse_settings({"join_headway_s": 2.5}, LccaSettings, "car.yaml")
