"""An unsafe vehicle sends BSMs more often; a safe one as often as the standard demands."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.access.adaptation import (
    LEAD_VALID_S,
    LEAST_REACTIONS,
    REACTION_HEADWAY_S,
    SAFE_BELOW,
    UNSAFE_ABOVE,
    AccessAdaptation,
    FollowingSafety,
    ReactionObserved,
)
from onboard.access.driver_model import DEFAULT_POPULATION, DriverModel
from onboard.access.settings import AccessSettings
from onboard.bsm_transmission.schedule import MAXIMUM_INTERVAL_S, MINIMUM_INTERVAL_S, BsmSchedule
from onboard.observations import BrakePedal, HardBrake, Lead, LeadIdentity, Speed
from onboard.sensors.host_state import HostState


class Adaptation(AccessAdaptation):
    """With the host vehicle's sensors that it reads."""

    def __init__(self, driver: DriverModel) -> None:
        self.host = HostState()
        super().__init__(driver, self.host)

    def receive_speed(self, speed: Speed) -> None:
        self.host.receive_observation(speed)


def adaptation(driver: DriverModel | None = None) -> Adaptation:
    return Adaptation(driver or DriverModel(DEFAULT_POPULATION))


def follow(
    core: Adaptation, gap_m: float | None, now: float = 0.0, closing_m_s: float = 0.0
) -> None:
    core.receive_speed(Speed(now, 20.0, 0.28, "obd:7e8"))
    core.receive_lead(Lead(now, LeadIdentity.UNKNOWN, None, gap_m, 0.5, closing_m_s, 0.1), now)


def test_it_is_off_by_default() -> None:
    assert not AccessSettings().enabled


def test_without_a_lead_the_vehicle_is_safe() -> None:
    core = adaptation()

    assert not core.is_unsafe
    assert core.safety_index == 1.0
    assert core.longest_interval_s == MAXIMUM_INTERVAL_S
    assert core.get_timer() == math.inf


def test_a_short_gap_is_unsafe_and_reported_once() -> None:
    core = adaptation()

    follow(core, 8.0)
    follow(core, 8.0, now=0.1)

    event = core.next_event()
    assert event == FollowingSafety(0.0, True, core.safety_index, MINIMUM_INTERVAL_S)
    assert core.safety_index < 0.3
    assert core.next_event() is None


def test_closing_makes_a_safe_gap_unsafe() -> None:
    steady, closing = adaptation(), adaptation()

    follow(steady, 35.0)
    follow(closing, 35.0, closing_m_s=8.0)

    assert not steady.is_unsafe
    assert closing.is_unsafe


def test_the_same_gap_is_unsafe_for_a_slow_driver_only() -> None:
    slow = DriverModel(DEFAULT_POPULATION)
    for _ in range(20):
        slow.receive_reaction(1.9, 1.2)
    default_core, slow_core = adaptation(), adaptation(slow)

    follow(default_core, 25.0)
    follow(slow_core, 25.0)

    assert not default_core.is_unsafe
    assert slow_core.is_unsafe


def test_between_the_thresholds_the_state_does_not_change() -> None:
    between_m = next(
        gap_m
        for gap_m in np.arange(5.0, 60.0, 0.1)
        if SAFE_BELOW < crash_probability_at(gap_m) < UNSAFE_ABOVE
    )
    from_safe, from_unsafe = adaptation(), adaptation()
    follow(from_safe, 60.0)
    follow(from_unsafe, 5.0)

    for core in (from_safe, from_unsafe):
        follow(core, between_m, now=0.1)

    assert not from_safe.is_unsafe
    assert from_unsafe.is_unsafe


def crash_probability_at(gap_m: float) -> float:
    core = adaptation()
    follow(core, gap_m)
    return 1.0 - core.safety_index


def test_a_lost_lead_is_safe_after_the_hold_time() -> None:
    core = adaptation()
    follow(core, 8.0, now=5.0)
    core.next_event()
    follow(core, None, now=5.5)

    assert core.get_timer() == 5.0 + LEAD_VALID_S
    core.handle_timer(5.9)
    assert core.is_unsafe
    core.handle_timer(6.0)

    assert core.next_event() == FollowingSafety(6.0, False, 1.0, MAXIMUM_INTERVAL_S)
    assert core.get_timer() == math.inf


def test_without_a_recent_speed_a_gap_is_ignored() -> None:
    core = adaptation()
    core.receive_lead(Lead(0.0, LeadIdentity.UNKNOWN, None, 3.0, 0.5, 0.0, 0.1), 0.0)
    core.receive_speed(Speed(0.0, 20.0, 0.28, "obd:7e8"))
    core.receive_lead(Lead(2.0, LeadIdentity.UNKNOWN, None, 3.0, 0.5, 0.0, 0.1), 2.0)

    assert not core.is_unsafe


def test_a_stopped_vehicle_is_safe() -> None:
    core = adaptation()
    core.receive_speed(Speed(0.0, 0.0, 0.28, "obd:7e8"))
    core.receive_lead(Lead(0.0, LeadIdentity.UNKNOWN, None, 1.0, 0.5, 0.0, 0.1), 0.0)

    assert core.safety_index == 1.0


def test_reactions_are_learned_and_reported() -> None:
    core = adaptation()
    follow(core, 30.0, now=10.1)
    follow(core, 30.0, now=10.2, closing_m_s=1.8)

    core.receive_brake_pedal(BrakePedal(11.3, True, "dbc:BRAKE.PEDAL"))

    assert core.driver.observed == 1
    event = core.next_event()
    assert isinstance(event, ReactionObserved)
    assert event.reaction_s == pytest.approx(1.2)
    assert event.headway_s == pytest.approx(1.5)


@pytest.mark.parametrize("reaction_s", [0.05, 20.0])
def test_impossible_reaction_times_are_counted_and_not_reported(reaction_s: float) -> None:
    core = adaptation()
    follow(core, 30.0, now=10.1)
    follow(core, 30.0, now=10.2, closing_m_s=1.8)

    core.receive_hard_brake(HardBrake(10.1 + reaction_s, 6.0, "obd:7e8"))

    assert (core.driver.observed, core.driver.rejected) == (0, 1)
    assert core.next_event() is None


@given(
    st.lists(
        st.tuples(st.none() | st.floats(-1.0, 200.0), st.floats(-40.0, 40.0), st.floats(0.0, 60.0)),
        max_size=20,
    ),
    st.floats(MINIMUM_INTERVAL_S, MAXIMUM_INTERVAL_S),
)
def test_the_interval_stays_between_100_ms_and_that_of_j2945_1(
    leads: list[tuple[float | None, float, float]], standard_s: float
) -> None:
    core = adaptation()
    for step, (gap_m, closing_m_s, speed_m_s) in enumerate(leads):
        now = 0.1 * step
        core.handle_timer(now)
        core.receive_speed(Speed(now, speed_m_s, 0.28, "obd:7e8"))
        lead = Lead(now, LeadIdentity.UNKNOWN, None, gap_m, 0.5, closing_m_s, 0.1)
        core.receive_lead(lead, now)

        assert 0.0 <= core.safety_index <= 1.0
        assert MINIMUM_INTERVAL_S <= min(standard_s, core.longest_interval_s) <= standard_s


def test_among_a_hundred_vehicles_the_unsafe_one_sends_four_times_as_often() -> None:
    schedule = BsmSchedule(np.random.default_rng(1), 0.0)
    for tenth in range(300):
        for car in range(100):
            schedule.receive_remote_vehicle(car.to_bytes(4), 50.0, 0.1 * tenth)
        schedule.handle_timer(0.1 * tenth)
    safe, unsafe = adaptation(), adaptation()
    follow(safe, 60.0)
    follow(unsafe, 8.0)

    intervals_s = [min(schedule.interval_s, core.longest_interval_s) for core in (safe, unsafe)]

    assert intervals_s == pytest.approx([0.4, 0.1], rel=0.01)
    assert math.isclose(intervals_s[0], schedule.interval_s), "a safe vehicle keeps to the standard"


def test_the_reaction_time_is_known_after_some_reactions() -> None:
    driver = DriverModel(DEFAULT_POPULATION)
    core = adaptation(driver)
    assert driver.percentile_s(0.5, REACTION_HEADWAY_S)[0] == pytest.approx(1.0, abs=0.01)
    for _ in range(LEAST_REACTIONS):
        assert core.reaction_s is None
        driver.receive_reaction(1.6, REACTION_HEADWAY_S)

    assert core.reaction_s == pytest.approx(1.5, abs=0.1)
