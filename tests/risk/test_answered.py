"""The monitor behind a car ahead while the own driver brakes: enough, too little, unevenly."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from onboard.kinematics.units import KM_H
from onboard.observations import BrakePedal, Lead, LeadIdentity, Speed
from onboard.risk.alarm import Alarm, Level
from onboard.risk.fcw import FCW, PEDAL_M_S2, fcw_level
from onboard.risk.lead_motion import LEAD_WINDOW_S
from onboard.risk.monitor import RiskMonitor
from onboard.risk.required_deceleration import (
    required_deceleration_m_s2,
    time_to_collision_s,
)
from onboard.risk.settings import RiskSettings

Braking = Callable[[float], float]
"""Time in s -> deceleration in m/s^2."""
FRAME_S = 0.05
SUB_STEPS = 10
STANDS_M_S = 0.05


@dataclass(frozen=True, slots=True)
class Moment:
    """Of a drive."""

    at_s: float
    gap_m: float
    speed_m_s: float
    lead_m_s: float


def drive(
    gap_m: float, speed: float, lead_speed: float, own: Braking, lead: Braking
) -> Iterator[Moment]:
    """In small steps until they touch or the own car stands, or for 12 s."""
    step_s = FRAME_S / SUB_STEPS
    for frame in range(round(12.0 / FRAME_S)):
        yield Moment(frame * FRAME_S, gap_m, speed, lead_speed)
        for sub in range(SUB_STEPS):
            at_s = frame * FRAME_S + sub * step_s
            next_speed = max(speed - own(at_s) * step_s, 0.0)
            next_lead = max(lead_speed - lead(at_s) * step_s, 0.0)
            gap_m += (lead_speed + next_lead - speed - next_speed) / 2.0 * step_s
            speed, lead_speed = next_speed, next_lead
            if gap_m <= 0.0 or speed < STANDS_M_S:
                yield Moment((frame + 1) * FRAME_S, gap_m, speed, lead_speed)
                return


def monitor() -> RiskMonitor:
    return RiskMonitor(RiskSettings(), 4.8, 1.8)


def tell(of: RiskMonitor, moment: Moment, *, pedal: bool | None, obd: bool = True) -> list[Alarm]:
    """One frame at 20 Hz, with the speed in whole km/h."""
    now = moment.at_s
    if obd:
        of.host.receive_observation(
            Speed(now, math.floor(moment.speed_m_s / KM_H) * KM_H, KM_H, "obd:7E8")
        )
    if pedal is not None:
        of.host.receive_observation(BrakePedal(now, pedal, "dbc:Brake.Pedal"))
    closing_m_s = moment.speed_m_s - moment.lead_m_s
    of.receive_event(
        Lead(now, LeadIdentity.UNKNOWN, gap_m=moment.gap_m, closing_speed_m_s=closing_m_s), now
    )
    return [event for event in iter(of.next_event, None) if isinstance(event, Alarm)]


def alarms(moments: list[Moment], *, pedal: bool | None = None) -> list[Alarm]:
    of = monitor()
    return [alarm for moment in moments for alarm in tell(of, moment, pedal=pedal)]


def warned_at_s(seen: list[Alarm]) -> list[float]:
    assert all(alarm.cause == FCW for alarm in seen)
    return [alarm.stamp_s for alarm in seen if alarm.level is Level.WARNING]


def constant(braking_m_s2: float) -> Braking:
    return lambda _: braking_m_s2


def ends_in_contact(moments: list[Moment]) -> bool:
    touch = moments[-1]
    return touch.gap_m <= 0.0 and touch.speed_m_s - touch.lead_m_s > 0.5


some_share_of_the_braking_needed = given(
    gap_m=st.floats(5.0, 80.0),
    speed=st.floats(8.0, 35.0),
    slower=st.floats(0.0, 15.0),
    share=st.floats(0.0, 1.0),
    lead_braking=st.sampled_from([0.0, 2.0, 4.0, 6.0, 8.0]),
)


@pytest.mark.long
@some_share_of_the_braking_needed
def test_slowing_down_that_ends_in_contact_is_warned_of_no_less_and_no_later(
    gap_m: float, speed: float, slower: float, share: float, lead_braking: float
) -> None:
    """The same alarms as with a released pedal, which never counts as braking."""
    lead_speed = max(speed - slower, 0.0)
    needed = required_deceleration_m_s2(gap_m, speed, lead_speed, lead_braking, 0.0)
    slowing = share * min(needed, PEDAL_M_S2)
    moments = list(drive(gap_m, speed, lead_speed, constant(slowing), constant(lead_braking)))
    assume(ends_in_contact(moments))

    assert alarms(moments) == alarms(moments, pedal=False)


@pytest.mark.long
@some_share_of_the_braking_needed
def test_held_braking_that_ends_in_contact_is_warned_of_as_soon_as_no_time_to_react_is_left(
    gap_m: float, speed: float, slower: float, share: float, lead_braking: float
) -> None:
    """By exact data, or then when a released pedal, which never counts as braking, leads to it.

    The braking of the lead is known after `LEAD_KNOWN_S`.
    """
    lead_speed = max(speed - slower, 0.0)
    braking = share * required_deceleration_m_s2(gap_m, speed, lead_speed, lead_braking, 0.0)
    assume(braking < 9.0)
    moments = list(drive(gap_m, speed, lead_speed, constant(braking), constant(lead_braking)))
    assume(ends_in_contact(moments))
    due = [moment.at_s for moment in moments if is_due(moment, braking, lead_braking)]
    assume(due != [])
    without = warned_at_s(alarms(moments, pedal=False))
    assume(without != [])
    latest_s = max(due[0], LEAD_KNOWN_S, without[0]) + TWO_FRAMES_S
    assume(latest_s < moments[-1].at_s)

    assert min(warned_at_s(alarms(moments))) <= latest_s


LEAD_KNOWN_S = 0.35
TWO_FRAMES_S = 2 * FRAME_S + 1e-9
FCW_SETTINGS = RiskSettings().fcw


def is_due(moment: Moment, braking: float, lead_braking: float) -> bool:
    """Whether FCW warns with braking neither known nor held in the reaction."""
    closing_m_s = moment.speed_m_s - moment.lead_m_s
    lead_braking = lead_braking if moment.lead_m_s > 0.0 else 0.0
    level, _ = fcw_level(
        moment.gap_m, moment.speed_m_s, closing_m_s, lead_braking, None, settings=FCW_SETTINGS
    )
    needed = required_deceleration_m_s2(
        moment.gap_m, moment.speed_m_s, moment.lead_m_s, lead_braking, 1.0, braking_m_s2=braking
    )
    ttc_s = time_to_collision_s(moment.gap_m, closing_m_s, braking)
    return (
        moment.speed_m_s >= RiskSettings().least_speed_m_s
        and level is Level.WARNING
        and (needed >= FCW_SETTINGS.warning_m_s2 or ttc_s <= FCW_SETTINGS.warning_ttc_s)
    )


@pytest.mark.parametrize("enough", [1.0, 1.3])
@pytest.mark.parametrize(
    ("gap_m", "speed", "lead_speed", "lead_braking"),
    [(35.0, 15.0, 0.0, 0.0), (20.0, 25.0, 15.0, 0.0), (8.0, 20.0, 20.0, 6.0)],
    ids=["standing", "slower", "braking"],
)
def test_a_driver_who_brakes_enough_from_the_beginning_is_not_warned(
    gap_m: float, speed: float, lead_speed: float, lead_braking: float, enough: float
) -> None:
    """With a released pedal there is a warning; whole km/h hide up to 1.4 m/s^2."""
    needed = required_deceleration_m_s2(gap_m, speed, lead_speed, lead_braking, 0.0)
    braking = enough * needed + 1.4
    moments = list(drive(gap_m, speed, lead_speed, constant(braking), constant(lead_braking)))
    known_s = 0.35

    assert moments[-1].gap_m > 0.0
    assert all(at_s < known_s for at_s in warned_at_s(alarms(moments)))
    assert warned_at_s(alarms(moments, pedal=False)) != []


LATER_S = 0.25
"""What the rule may cost him whose braking was meant for something else."""


@pytest.mark.parametrize("own_braking", [1.0, 2.0, 3.0])
@pytest.mark.parametrize("lead_braking", [4.0, 6.0, 8.0])
@pytest.mark.parametrize(("gap_m", "speed"), [(8.0, 14.0), (15.0, 20.0), (30.0, 30.0)])
def test_who_brakes_gently_for_something_else_is_warned_when_the_lead_brakes_hard(
    gap_m: float, speed: float, own_braking: float, lead_braking: float
) -> None:
    moments = list(
        drive(
            gap_m, speed, speed, constant(own_braking),
            lambda t: own_braking if t < 1.0 else lead_braking,
        )
    )  # fmt: skip
    warned, warned_without = (warned_at_s(alarms(moments, pedal=pedal)) for pedal in (None, False))

    after_onset = min(at_s for at_s in warned_without if at_s > 1.0 - 1e-9)
    if moments[-1].gap_m <= 0.0:
        assert min(warned) <= after_onset + LATER_S
    else:
        assert (own_braking, lead_braking) == (3.0, 4.0)  # enough after all


def test_a_driver_who_releases_the_brake_too_early_is_warned_again() -> None:
    """3 m/s^2 is enough behind a standing car, but ends after 1.2 s. The pedal shows it at once."""
    moments = list(drive(44.0, 16.0, 0.0, lambda t: 3.9 if t < 1.2 else 0.0, constant(0.0)))

    by_speed, by_pedal = warned_at_s(alarms(moments)), []
    of = monitor()
    for moment in moments:
        by_pedal += warned_at_s(tell(of, moment, pedal=moment.at_s < 1.2))

    assert moments[-1].gap_m <= 0.0
    assert by_pedal == [pytest.approx(1.25)]  # the second frame
    assert 1.25 <= by_speed[0] <= 1.25 + LATER_S


@pytest.mark.parametrize("period_s", [0.2, 0.5, 1.0, 1.9])
def test_braking_that_wavers_does_not_make_the_alarm_flicker(period_s: float) -> None:
    """Between 1 and 8 m/s^2: up at once, down after a second, so not more than once a second."""
    moments = list(
        drive(
            40.0, 25.0, 18.0, lambda t: 8.0 if t % period_s < period_s / 2 else 1.0, constant(5.0)
        )
    )

    seen = alarms(moments)

    warned = warned_at_s(seen)
    assert warned != []
    assert all(later - sooner > 1.0 for sooner, later in pairwise(warned))


def test_an_alarm_that_is_answered_goes_down_a_second_later_and_comes_back_at_once() -> None:
    of, seen = monitor(), []
    for k in range(80):
        now = k * FRAME_S
        brakes = 1.0 <= now < 3.0
        speed = 20.0 - 6.0 * max(min(now, 3.0) - 1.0, 0.0)
        gap_m = 0.5 * speed + 0.9 * speed**2 / 10.0  # always as urgent, and 5.6 m/s^2 is enough
        seen += tell(of, Moment(now, gap_m, speed, 0.0), pedal=brakes)

    levels = [(round(alarm.stamp_s, 2), alarm.level) for alarm in seen]
    assert [level for _, level in levels] == [Level.WARNING, Level.CAUTION, Level.WARNING]
    (raised_s, _), (down_s, _), (again_s, _) = levels
    assert raised_s == pytest.approx(0.05)
    assert 2.0 < down_s < 2.6
    assert again_s == pytest.approx(3.05, abs=0.051)


def test_without_a_recent_speed_braking_is_not_known_to_be_enough() -> None:
    """Samples stop while the driver brakes enough: the alarm lasts until they are too old."""
    moments = list(drive(35.0, 16.0, 0.0, constant(6.0), constant(0.0)))
    of, seen = monitor(), []
    for moment in moments:
        seen += tell(of, moment, pedal=None, obd=moment.at_s < 0.8)

    (warned,) = [at_s for at_s in warned_at_s(seen) if at_s > 0.4]
    assert 0.75 + LEAD_WINDOW_S < warned < 1.75 + 1e-9
