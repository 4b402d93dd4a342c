"""How hard the driver will have to brake, and NHTSA's and FMVSS 127's cases."""

import math
from collections.abc import Callable, Mapping

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from onboard.kinematics.units import KM_H, MPH, STANDARD_GRAVITY_M_S2
from onboard.observations import Lead, LeadIdentity, Speed
from onboard.risk.alarm import Alarm, Level
from onboard.risk.fcw import FCW, fcw_level, settled_closing_speed_m_s
from onboard.risk.lead_motion import LeadMotion
from onboard.risk.monitor import RiskMonitor
from onboard.risk.required_deceleration import (
    brakes_enough,
    required_deceleration_m_s2,
    time_to_collision_s,
)
from onboard.risk.settings import FcwSettings, RiskSettings

Motion = Callable[[float], tuple[float, float]]
"""Time in s -> (distance driven in m, speed in m/s)."""


def braking(speed_m_s: float, deceleration_m_s2: float, from_s: float = 0.0) -> Motion:
    def motion(time_s: float) -> tuple[float, float]:
        braked_s = max(time_s - from_s, 0.0)
        if deceleration_m_s2 > 0.0:
            braked_s = min(braked_s, speed_m_s / deceleration_m_s2)
        steady_m = speed_m_s * min(time_s, from_s)
        after_m = speed_m_s * braked_s - deceleration_m_s2 * braked_s**2 / 2
        if deceleration_m_s2 == 0.0:
            return speed_m_s * time_s, speed_m_s
        return steady_m + after_m, speed_m_s - deceleration_m_s2 * braked_s

    return motion


def least_gap_m(gap_m: float, own: Motion, lead: Motion, until_s: float = 30.0) -> float:
    return min(gap_m + lead(t)[0] - own(t)[0] for t in np.linspace(0.0, until_s, 1500))


BEHIND_A_LEAD: Mapping[str, st.SearchStrategy[float]] = {
    "gap_m": st.floats(1.0, 150.0),
    "speed": st.floats(0.0, 40.0),
    "lead_speed": st.floats(0.0, 40.0),
    "lead_braking": st.sampled_from([0.0, 1.0, 3.0, 6.0, 9.0]),
}


@pytest.mark.long
@given(**BEHIND_A_LEAD)
def test_the_braking_asked_for_just_avoids_the_lead(
    gap_m: float, speed: float, lead_speed: float, lead_braking: float
) -> None:
    needed = required_deceleration_m_s2(gap_m, speed, lead_speed, lead_braking, 1.0)
    assume(0.05 < needed < 100.0)
    lead = braking(lead_speed, lead_braking)
    standing_s = 1.0 + speed / (0.95 * needed)

    assert least_gap_m(gap_m, braking(speed, needed * 1.01, 1.0), lead, standing_s) >= 0.0
    assert least_gap_m(gap_m, braking(speed, needed * 0.95, 1.0), lead, standing_s) <= 0.02


@pytest.mark.long
@given(**BEHIND_A_LEAD, held=st.floats(0.1, 9.0))
def test_the_braking_asked_for_after_braking_through_the_reaction_just_avoids_the_lead(
    gap_m: float, speed: float, lead_speed: float, lead_braking: float, held: float
) -> None:
    needed = required_deceleration_m_s2(
        gap_m, speed, lead_speed, lead_braking, 1.0, braking_m_s2=held
    )
    assume(0.05 < needed < 100.0)
    lead, until_reaction = braking(lead_speed, lead_braking), braking(speed, held)
    then_m, then_m_s = until_reaction(1.0)

    def least_with(after_m_s2: float) -> float:
        after = braking(then_m_s, after_m_s2)
        standing_s = 1.0 + then_m_s / (0.95 * needed)

        def own(time_s: float) -> tuple[float, float]:
            if time_s <= 1.0:
                return until_reaction(time_s)
            driven_m, speed_m_s = after(time_s - 1.0)
            return then_m + driven_m, speed_m_s

        return least_gap_m(gap_m, own, lead, standing_s)

    assert least_with(needed * 1.01) >= 0.0
    assert least_with(needed * 0.95) <= 0.02


@pytest.mark.parametrize(
    ("gap_m", "speed", "lead", "held", "expected"),
    [
        (5.0, 3.0, (0.0, 0.0), 4.0, 0.0),
        (1.6, 20.0, (15.5, 4.0), 10.0, math.inf),
        (1.7, 20.0, (15.5, 4.0), 10.0, 0.0),
    ],
    ids=["stands sooner", "touches before it is slower", "is slower before it touches"],
)
def test_who_is_slower_than_the_lead_after_the_reaction_needs_nothing_unless_he_touches_before(
    gap_m: float, speed: float, lead: tuple[float, float], held: float, expected: float
) -> None:
    assert required_deceleration_m_s2(gap_m, speed, *lead, 1.0, braking_m_s2=held) == expected


STEP_S = 2e-3


def touches(
    gap_m: float, speeds_m_s: tuple[float, float], braking_m_s2: tuple[float, float]
) -> bool:
    """Both go on braking as they do until they stand, in small steps; own first, then the lead."""
    (speed, lead_speed), (braking, lead_braking) = speeds_m_s, braking_m_s2
    while gap_m > 0.0 and speed > 0.0:
        next_speed = max(speed - braking * STEP_S, 0.0)
        next_lead = max(lead_speed - lead_braking * STEP_S, 0.0)
        gap_m += (lead_speed + next_lead - speed - next_speed) / 2.0 * STEP_S
        if next_lead == lead_speed and speed <= lead_speed:
            return False  # a lead at constant speed gets away, however weakly the host brakes
        speed, lead_speed = next_speed, next_lead
    return gap_m <= 0.0


@given(
    gap_m=st.floats(0.2, 100.0),
    speed=st.floats(2.0, 40.0),
    lead_speed=st.floats(-3.0, 40.0),
    braking=st.floats(0.0, 9.0),
    lead_braking=st.sampled_from([0.0, 1.5, 3.0, 6.0, 9.0]),
)
def test_braking_is_enough_exactly_if_there_is_no_contact(
    gap_m: float, speed: float, lead_speed: float, braking: float, lead_braking: float
) -> None:
    def answered(braking_m_s2: float) -> bool:
        return brakes_enough(gap_m, speed, lead_speed, lead_braking, braking_m_s2)

    lead = max(lead_speed, 0.0)  # one that reverses counts as standing
    assume(answered(braking * 0.98) == answered(braking * 1.02))  # not at the boundary

    assert answered(braking) != touches(gap_m, (speed, lead), (braking, lead_braking))


@pytest.mark.parametrize("braking", [None, math.nan])
def test_unknown_braking_is_not_enough(braking: float | None) -> None:
    assert not brakes_enough(100.0, 5.0, 20.0, 0.0, braking)


BEHIND_A_STANDING_CAR = {
    "far": (60.0, Level.NONE),
    "nearer": (31.0, Level.CAUTION),
    "near": (25.0, Level.WARNING),
}
"""At 10 m/s: the gap, and the alarm for a driver who does not brake. 5 m/s^2 need 10 m to stop."""


@pytest.mark.parametrize(("braking", "is_enough"), [(None, False), (0.0, False), (5.0, True)])
@pytest.mark.parametrize("place", BEHIND_A_STANDING_CAR)
def test_a_driver_who_brakes_enough_gets_a_caution_at_most(
    place: str, braking: float | None, is_enough: bool
) -> None:
    gap_m, before = BEHIND_A_STANDING_CAR[place]

    seen, needed = fcw_level(gap_m, 10.0, 10.0, 0.0, braking, settings=FcwSettings())

    assert seen is (Level.CAUTION if is_enough and before is Level.WARNING else before)
    assert needed == required_deceleration_m_s2(gap_m, 10.0, 0.0, 0.0, 1.0)


SLOWING_FOR_A_CORNER = {
    "10 m/s": (19.0, 9.7, 2.0, 3.5, 1.6),
    "13 m/s": (32.0, 12.9, 0.5, 0.0, 2.1),
    "11 m/s": (16.0, 10.8, 6.6, 3.5, 1.7),
}
"""Of drivers of the city who brake behind one that slows down, and stop in time: gap, both speeds,
braking of the lead, and one's own."""


@pytest.mark.parametrize("place", SLOWING_FOR_A_CORNER)
def test_braking_that_leaves_time_to_react_is_cautioned_and_no_braking_is_warned(
    place: str,
) -> None:
    """The driver has to brake harder yet, but 1 s later will do, and is slower by then."""
    gap_m, speed, lead_speed, lead_braking, own = SLOWING_FOR_A_CORNER[place]

    def level(braking_m_s2: float | None) -> Level:
        return fcw_level(
            gap_m, speed, speed - lead_speed, lead_braking, braking_m_s2, settings=FcwSettings()
        )[0]

    assert not brakes_enough(gap_m, speed, lead_speed, lead_braking, own)
    assert level(own) is Level.CAUTION
    assert level(0.0) is level(None) is level(math.nan) is Level.WARNING


@pytest.mark.parametrize(
    ("gap_m", "held"),
    [(16.0, 2.5), (24.0, 0.9), (17.0, 1.0)],
    ids=["which has to be hard", "of an engine", "that leaves no time"],
)
def test_who_brakes_otherwise_is_warned(gap_m: float, held: float) -> None:
    seen, _ = fcw_level(gap_m, 10.0, 10.0, 0.0, held, settings=FcwSettings())

    assert seen is Level.WARNING


def test_no_braking_is_asked_for_behind_a_faster_car_and_none_helps_too_late() -> None:
    assert required_deceleration_m_s2(10.0, 20.0, 25.0, 0.0, 1.0) == 0.0
    assert required_deceleration_m_s2(10.0, 20.0, 0.0, 0.0, 1.0) == math.inf


def test_time_to_collision() -> None:
    assert time_to_collision_s(20.0, 10.0) == 2.0
    assert time_to_collision_s(20.0, 0.0) == math.inf
    assert time_to_collision_s(20.0, -3.0) == math.inf


@pytest.mark.parametrize(("held", "expected_s"), [(0.0, 2.0), (2.5, 4.0), (2.6, math.inf)])
def test_time_to_collision_while_the_braking_is_held(held: float, expected_s: float) -> None:
    assert time_to_collision_s(20.0, 10.0, held) == expected_s


def test_the_lead_cars_braking_is_the_slope_of_its_speed_and_a_cut_in_starts_anew() -> None:
    motion = LeadMotion()
    for k in range(12):
        motion.receive_speed(k * 0.05, 30.0 - k * 0.1, 20.0 - 4.0 * k * 0.05)
    assert motion.deceleration_m_s2() == pytest.approx(4.0)

    motion.receive_speed(0.6, 12.0, 17.0)
    assert motion.deceleration_m_s2() == 0.0


def first_warning_s(
    gap_m: float,
    own: Motion,
    lead: Motion,
    until_s: float = 12.0,
    reaction_s: float | None = None,
) -> float | None:
    """Drive both with a camera at 20 Hz and a speed at 10 Hz in whole km/h; no alarm: None."""
    monitor = RiskMonitor(RiskSettings(), 4.8, 1.8)
    if reaction_s is not None:
        monitor.receive_reaction_time(reaction_s)
    for k in range(int(until_s * 20)):
        now = k / 20
        (own_m, own_v), (lead_m, lead_v) = own(now), lead(now)
        left_m = gap_m + lead_m - own_m
        if left_m <= 0.0:
            return None
        if k % 2 == 0:
            coarse = math.floor(own_v / KM_H) * KM_H
            monitor.host.receive_observation(Speed(now, coarse, KM_H, "obd:7E8"))
        monitor.receive_event(
            Lead(now, LeadIdentity.UNKNOWN, gap_m=left_m, closing_speed_m_s=own_v - lead_v), now
        )
        while (event := monitor.next_event()) is not None:
            if isinstance(event, Alarm) and event.level is Level.WARNING:
                assert event.cause == FCW
                return now
    return None


@pytest.mark.parametrize(
    "case",
    [(150.0, 45, 0, 0.0, 2.1), (30.0, 45, 45, 0.3, 2.4), (150.0, 45, 20, 0.0, 2.0)],
    ids=["stopped", "decelerating", "slower"],
)
@pytest.mark.parametrize("reaction_s", [None, 0.3, 1.5])
def test_nhtsa_confirmation_test(
    case: tuple[float, float, float, float, float], reaction_s: float | None
) -> None:
    """Time to collision at the alert, with the lead's braking, as in NHTSA's FCW test procedure."""
    gap_m, own_mph, lead_mph, lead_braking_g, least_s = case
    own = braking(own_mph * MPH, 0.0)
    lead = braking(lead_mph * MPH, lead_braking_g * STANDARD_GRAVITY_M_S2)
    collision_s = next(t for t in np.arange(0, 20, 0.005) if gap_m + lead(t)[0] - own(t)[0] <= 0.0)

    warned_s = first_warning_s(gap_m, own, lead, reaction_s=reaction_s)

    assert warned_s is not None
    assert collision_s - warned_s >= least_s


DRIVER_REACTION_S, DRIVER_BRAKING_M_S2 = 1.0, 8.0
FMVSS_127 = [
    (speed_km_h, headway_m, braking_g)
    for speed_km_h in (50, 80)
    for headway_m in (12.0, 25.0, 40.0)
    for braking_g in (0.3, 0.4, 0.5)
]


@pytest.mark.parametrize(("speed_km_h", "headway_m", "braking_g"), FMVSS_127)
def test_fmvss_127_decelerating_lead(speed_km_h: float, headway_m: float, braking_g: float) -> None:
    """Both have the same speed, the lead brakes; braking 1 s after the warning avoids contact."""
    assert stays_clear(speed_km_h, headway_m, braking_g, DRIVER_REACTION_S)


def test_with_a_late_driver_known_more_of_fmvss_127s_cases_end_without_contact() -> None:
    """At 12 m and 0.4 g or more, 1.5 s are too long for any warning."""
    known, unknown = (
        [stays_clear(*case, 1.5, is_known=is_known) for case in FMVSS_127]
        for is_known in (True, False)
    )
    assert sum(known) == 14
    assert sum(unknown) < 14


def stays_clear(
    speed_km_h: float,
    headway_m: float,
    braking_g: float,
    reaction_s: float,
    *,
    is_known: bool = False,
) -> bool:
    speed_m_s = speed_km_h * KM_H
    lead = braking(speed_m_s, braking_g * STANDARD_GRAVITY_M_S2)
    own = braking(speed_m_s, 0.0)
    learnt_s = reaction_s if is_known else None
    warned_s = first_warning_s(headway_m, own, lead, reaction_s=learnt_s)
    assert warned_s is not None

    own = braking(speed_m_s, DRIVER_BRAKING_M_S2, warned_s + reaction_s)
    return least_gap_m(headway_m, own, lead) > 0.0


def test_a_driver_who_reacts_late_is_warned_early() -> None:
    """Within the limits of `driver_reaction`, behind a standing car and behind a braking one."""
    own, standing, slowing = braking(20.0, 0.0), braking(0.0, 0.0), braking(20.0, 2.0)

    def warned(lead: Motion, gap_m: float) -> list[float]:
        each = [first_warning_s(gap_m, own, lead, reaction_s=each) for each in REACTIONS_S]
        return [at_s for at_s in each if at_s is not None]

    shortest, short, usual, long, longest = warned(standing, 150.0)
    assert shortest == short == usual
    assert long == longest == pytest.approx(usual - 0.5, abs=0.051)
    shortest, short, usual, long, longest = warned(slowing, 40.0)
    assert shortest == short == usual
    assert long == longest < usual


REACTIONS_S = 0.2, 0.7, 1.0, 1.5, 2.5


@pytest.mark.parametrize("headway_s", [1.0, 1.5, 2.0])
def test_following_steadily_raises_no_alarm_for_a_slow_driver(headway_s: float) -> None:
    steady = braking(25.0, 0.0)
    gap_m = headway_s * 25.0
    assert first_warning_s(gap_m, steady, steady, until_s=20.0, reaction_s=1.5) is None


@pytest.mark.parametrize("headway_s", [1.0, 1.5, 2.0])
def test_following_steadily_raises_no_alarm(headway_s: float) -> None:
    v = 25.0
    steady = braking(v, 0.0)

    assert first_warning_s(headway_s * v, steady, steady, until_s=20.0) is None


def test_a_noisy_camera_behind_a_steady_car_raises_no_alarm() -> None:
    rng = np.random.default_rng(1)
    monitor = RiskMonitor(RiskSettings(), 4.8, 1.8)
    for k in range(20 * 60):
        now = k / 20
        monitor.host.receive_observation(Speed(now, 25.0, KM_H, "obd:7E8"))
        monitor.receive_event(
            Lead(
                now,
                LeadIdentity.UNKNOWN,
                gap_m=35.0 + 0.5 * rng.normal(),
                closing_speed_m_s=0.5 * rng.normal(),
            ),
            now,
        )

    assert monitor.next_event() is None


@pytest.mark.parametrize("frames_a_second", [8, 10, 15, 20, 30])
@pytest.mark.parametrize("odd_m_s", [-15.0, 5.0, 15.0])
def test_one_odd_frame_raises_no_alarm(odd_m_s: float, frames_a_second: int) -> None:
    """Not by itself, though it is looked at again until the next one, nor as braking."""
    monitor = RiskMonitor(RiskSettings(), 4.8, 1.8)
    for k in range(4 * frames_a_second):
        now = k / frames_a_second
        closing_m_s = odd_m_s if k == 2 * frames_a_second else 0.0
        monitor.host.receive_observation(Speed(now, 20.0, KM_H, "obd:7E8"))
        monitor.receive_event(
            Lead(now, LeadIdentity.UNKNOWN, gap_m=30.0, closing_speed_m_s=closing_m_s), now
        )
        monitor.assess(None, [], now + 0.9 / frames_a_second)

    assert monitor.next_event() is None


SETTLING_SIGMA_M_S = (7.9, 1.5, 1.2, 1.1)
"""Of a new car's closing speed, frame by frame at 24 m, as vision states it (then 1.0)."""


@pytest.mark.parametrize("error_m_s", [4.0, 8.0, 12.0])
def test_a_new_lead_raises_no_alarm_while_its_speed_settles(error_m_s: float) -> None:
    """The first closing speed has any error, within its sigma."""
    monitor = RiskMonitor(RiskSettings(), 4.8, 1.8)
    for k in range(30):
        now = k / 10
        sigma = SETTLING_SIGMA_M_S[k] if k < len(SETTLING_SIGMA_M_S) else 1.0
        monitor.host.receive_observation(Speed(now, 20.0, KM_H, "obd:7E8"))
        monitor.receive_event(
            Lead(now, LeadIdentity.UNKNOWN, gap_m=24.0, gap_sigma_m=1.0,
                 closing_speed_m_s=error_m_s * (sigma / 7.9) ** 2, closing_speed_sigma_m_s=sigma),
            now,
        )  # fmt: skip

    assert monitor.next_event() is None


def test_a_standing_car_that_comes_into_view_warns_once_its_speed_has_settled() -> None:
    monitor = RiskMonitor(RiskSettings(), 4.8, 1.8)
    alarms = []
    for k in range(8):
        now = k / 10
        sigma = SETTLING_SIGMA_M_S[k] if k < len(SETTLING_SIGMA_M_S) else 1.0
        monitor.host.receive_observation(Speed(now, 20.0, KM_H, "obd:7E8"))
        monitor.receive_event(
            Lead(now, LeadIdentity.UNKNOWN, gap_m=40.0 - 2.0 * k, gap_sigma_m=1.0,
                 closing_speed_m_s=20.0, closing_speed_sigma_m_s=sigma),
            now,
        )  # fmt: skip
        alarms += [event for event in iter(monitor.next_event, None) if isinstance(event, Alarm)]

    assert alarms[0].level is Level.WARNING
    assert alarms[0].stamp_s <= 0.2


@pytest.mark.parametrize(
    ("closing_m_s", "sigma_m_s", "counts_m_s"),
    [(10.0, 0.0, 10.0), (10.0, 1.0, 10.0), (10.0, 1.5, 10.0), (10.0, 4.0, 5.0), (1.0, 8.0, -12.0)],
)
def test_what_an_unsettled_closing_speed_counts(
    closing_m_s: float, sigma_m_s: float, counts_m_s: float
) -> None:

    assert settled_closing_speed_m_s(closing_m_s, sigma_m_s) == pytest.approx(counts_m_s)
