"""Warnings of the studies' drivers, and the paper's alarm."""

import math
from dataclasses import replace

import pytest

from onboard.brake_request.brake_requester import BrakeRequest
from onboard.brake_request.settings import BrakeRequestSettings
from onboard.lcca.events import WarningOver, WarningRaised
from onboard.observations import BrakeCause, Lead, LeadIdentity, Speed
from onboard.risk.alarm import RELEASE_S
from onboard.risk.fcw import FCW
from onboard.risk.lcca_warning import LCCA
from onboard.risk.settings import RiskSettings
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from sim_rig.studies.mvs.driver_warning import DriverWarning, WarningModel
from sim_rig.studies.mvs.paper_alarm import paper_alarm

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


def warned_at_s(lead: PerceivedObject, *, braking_m_s2: float = 0.0) -> float | None:
    """Drive 0.8 s at nearly the same gap, judged ten times a second."""
    model = WarningModel(RiskSettings(), 4.5, 1.8)
    for tick in range(-6, 8):
        now, speed_m_s = tick / 10, SPEED_M_S - braking_m_s2 * tick / 10
        model.receive_observation(Speed(now, speed_m_s, 0.02, "test"), now)
        if tick < 0:
            continue
        seen = replace(lead, stamp_s=now)
        for warning in model.assess(car("own", 0.0, speed_m_s), [seen], now):
            assert warning == DriverWarning(FCW, seen)
            return now
    return None


def test_a_warning_is_the_risk_monitors() -> None:
    assert warned_at_s(car("lead", 35.0, 0.0)) == 0.1
    assert warned_at_s(car("lead", 35.0, SPEED_M_S)) is None


def test_a_driver_is_warned_of_the_vehicle_ahead_of_the_camera() -> None:
    """It stands; no object is perceived there."""
    model = WarningModel(RiskSettings(), 4.5, 1.8)
    lead = Lead(0.0, LeadIdentity.UNKNOWN, None, 25.0, 0.3, SPEED_M_S, 0.3)
    model.receive_observation(Speed(0.0, SPEED_M_S, 0.02, "test"), 0.0)
    own = car("own", 0.0, SPEED_M_S)
    assert model.assess(own, [], 0.0) == []

    for frame in range(5):
        now = frame / 10
        seen = replace(lead, stamp_s=now, gap_m=25.0 - SPEED_M_S * now)
        model.receive_observation(Speed(now, SPEED_M_S, 0.02, "test"), now)
        model.receive_observation(seen, now)

    (warning,) = model.assess(own, [], 0.4)
    assert warning.cause == FCW
    assert isinstance(warning.of, Lead)


def test_a_driver_is_warned_of_a_braking_in_the_group_until_it_is_over() -> None:
    model = WarningModel(RiskSettings(), 4.5, 1.8)
    own = car("own", 0.0, SPEED_M_S)
    begun = WarningRaised(
        0.0, bytes(8), 1, 1, 2, bytes(8), BrakeCause.DECELERATION, 6.0, age_s=0.1, hops=1
    )
    model.receive_group_warning(begun, 0.0)
    assert model.assess(own, [], 0.1) == [DriverWarning(LCCA, begun)]

    model.receive_group_warning(WarningOver(0.2, bytes(8), 1, "over"), 0.2)
    assert model.assess(own, [], 0.2 + RELEASE_S) == []


def test_a_driver_who_brakes_enough_when_the_radio_is_switched_on_is_not_warned() -> None:
    assert warned_at_s(car("lead", 35.0, 0.0), braking_m_s2=6.0) is None


@pytest.mark.parametrize(
    ("source", "brakes"), [(ObjectSource.SENSOR, True), (ObjectSource.BSM, False)]
)
def test_a_car_requests_to_brake_for_what_its_own_sensors_see(
    source: ObjectSource, *, brakes: bool
) -> None:
    """By default, radio alone is not certain enough."""
    model = WarningModel(RiskSettings(), 4.5, 1.8, BrakeRequestSettings())
    requested: list[BrakeRequest] = []
    for tick in range(-6, 4):
        now = tick / 10
        model.receive_observation(Speed(now, SPEED_M_S, 0.02, "test"), now)
        if tick < 0:
            continue
        seen = replace(car("lead", 35.0, 0.0), stamp_s=now, source=source)
        sensed = [seen] if source is ObjectSource.SENSOR else []
        model.assess(car("own", 0.0, SPEED_M_S), [seen], now, sensed=sensed)
        requested += model.take_brake_requests()

    assert bool(requested) is brakes
    assert all(request.deceleration_m_s2 > 3.0 for request in requested)


def test_a_car_requests_to_brake_as_soon_as_its_camera_shows_the_danger() -> None:
    """As the car's own cores do, which do not wait for the next assessment."""
    model = WarningModel(RiskSettings(), 4.5, 1.8, BrakeRequestSettings())
    model.assess(car("own", 0.0, SPEED_M_S), [], 0.0)
    for frame in range(8):
        now = frame / 15
        model.receive_observation(Speed(now, SPEED_M_S, 0.02, "test"), now)
        gap_m = 20.0 - SPEED_M_S * now
        model.receive_observation(
            Lead(now, LeadIdentity.UNKNOWN, None, gap_m, 0.3, SPEED_M_S, 0.3), now
        )

    assert list(model.take_brake_requests())


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


def test_the_end_of_one_vehicles_warning_leaves_the_other_vehicles() -> None:
    """Two vehicles cross: when the first has passed, the second is still warned of."""
    model = WarningModel(RiskSettings(), 4.5, 1.8)
    names = []
    for tick in range(-6, 24):
        now = tick / 10
        model.receive_observation(Speed(now, SPEED_M_S, 0.02, "test"), now)
        own = car("own", SPEED_M_S * (now - 2.3), SPEED_M_S, acceleration_m_s2=0.0)
        crossing = [
            car(
                name,
                0.0,
                SPEED_M_S,
                north_m=SPEED_M_S * (now - meets_s),
                course_rad=math.pi / 2,
                acceleration_m_s2=0.0,
            )
            for name, meets_s in (("first", 2.3), ("second", 2.3))
            if name == "second" or now < 0.5
        ]
        objects = [replace(each, stamp_s=now) for each in crossing]
        active = model.assess(replace(own, stamp_s=now), objects, now)
        names.append({each.of.name for each in active if isinstance(each.of, PerceivedObject)})

    assert {"first", "second"} in names
    assert names[-1] == {"second"}
