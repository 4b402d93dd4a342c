"""Warnings of the studies' drivers, and the paper's alarm."""

import math
from itertools import cycle

import pytest

from onboard.mvs.perceived_object import ObjectSource, PerceivedObject
from onboard.risk.alarm import Cause
from onboard.risk.settings import RiskSettings
from sim_rig.studies.mvs_driver_warning import DriverWarning, WarningModel
from sim_rig.studies.mvs_paper_alarm import paper_alarm

SPEED_M_S = 15.0


def car(
    name: str,
    east_m: float,
    speed_m_s: float,
    *,
    north_m: float = 0.0,
    course_rad: float = 0.0,
    sigma_m_s: float = 0.5,
    acceleration_m_s2: float | None = None,
) -> PerceivedObject:
    spread = (0.25, 0.25, sigma_m_s**2, sigma_m_s**2)
    covariance = tuple(tuple(v if i == j else 0.0 for j in range(4)) for i, v in enumerate(spread))
    velocity = speed_m_s * math.cos(course_rad), speed_m_s * math.sin(course_rad)
    source = ObjectSource.HOST if name == "own" else ObjectSource.BSM
    return PerceivedObject(
        0.0, name, source, (east_m, north_m, *velocity), covariance, 0.0, frozenset(),
        acceleration_m_s2,
    )  # fmt: skip


def each_tick(*leads: PerceivedObject, braking_m_s2: float = 0.0) -> list[DriverWarning | None]:
    """0.8 s at nearly the same gap, judged ten times a second.

    Several `leads` are estimates of one car, used in turn.
    """
    model = WarningModel(RiskSettings(), 4.5, 1.8)
    speeds_m_s = [SPEED_M_S - braking_m_s2 * step / 10 for step in range(8)]
    return [
        model.assess(car("own", 0.0, speed_m_s), [lead], speed_m_s, step / 10)
        for step, (speed_m_s, lead) in enumerate(zip(speeds_m_s, cycle(leads), strict=False))
    ]


def drive_up_to(lead: PerceivedObject) -> DriverWarning | None:
    """The warning at the end."""
    return each_tick(lead)[-1]


def test_a_standing_car_close_ahead_raises_a_warning() -> None:
    warned = drive_up_to(car("lead", 35.0, 0.0))

    assert warned is not None
    assert (warned.cause, warned.target.name) == (Cause.FCW, "lead")


def test_a_wrong_speed_in_a_single_tick_raises_no_warning() -> None:
    """As in the car, which waits for a second image (`confirm_s`)."""
    as_it_is, for_a_tick = car("lead", 18.0, SPEED_M_S), car("lead", 18.0, SPEED_M_S - 6.0)

    assert drive_up_to(for_a_tick) is not None
    assert not any(each_tick(as_it_is, as_it_is, as_it_is, for_a_tick))


def test_an_uncertain_closing_speed_is_reduced() -> None:
    assert drive_up_to(car("lead", 18.0, SPEED_M_S - 6.0)) is not None
    assert drive_up_to(car("lead", 18.0, SPEED_M_S - 6.0, sigma_m_s=3.5)) is None


def test_a_car_that_brakes_hard_enough_is_not_warned() -> None:
    """Nor at the start, when its own deceleration is not known yet."""
    assert not any(each_tick(car("lead", 35.0, 0.0), braking_m_s2=6.0))


def test_the_braking_that_a_remote_vehicle_reports_counts() -> None:
    assert drive_up_to(car("lead", 22.0, SPEED_M_S)) is None
    assert drive_up_to(car("lead", 22.0, SPEED_M_S, acceleration_m_s2=-7.0)) is not None


def alarm_target(*others: PerceivedObject, within_s: float = 10.0) -> str | None:
    own = car("own", 0.0, SPEED_M_S)
    target = paper_alarm(own, list(others), (4.5, 1.8), within_s)
    return None if target is None else target.name


@pytest.mark.parametrize(("within_s", "name"), [(2.5, None), (4.0, "other"), (10.0, "other")])
def test_the_papers_alarm_is_of_who_would_be_paper_alarm(within_s: float, name: str | None) -> None:
    """Both are 3 s from where their paths cross."""
    crossing = car("other", 45.0, SPEED_M_S, north_m=-45.0, course_rad=math.pi / 2)

    assert alarm_target(crossing, within_s=within_s) == name


def test_the_papers_alarm_is_for_the_first_hit_and_not_for_passing_cars() -> None:
    slow = car("slow", 60.0, SPEED_M_S - 8.0)
    standing = car("standing", 80.0, 0.1)
    beside = car("beside", 30.0, SPEED_M_S - 8.0, north_m=3.5)
    ahead = car("ahead", 20.0, SPEED_M_S + 1.0)
    uncertain = car("uncertain", 15.0, SPEED_M_S - 8.0, sigma_m_s=3.0)

    assert alarm_target(standing, beside, slow, ahead, uncertain) == "standing"
    assert alarm_target(beside, ahead) is None
    assert alarm_target() is None
