"""At each limit itself: which side of it a request falls on."""

import pytest

from onboard.brake_request.brake_requester import HOLD_S, OLDEST_S, STANDS_M_S
from onboard.observations import Speed
from onboard.risk.alarm import NOTHING, AlarmReason, Assessment, Level
from tests.brake_request.test_brake_requester import (
    FCW_ALARM,
    assessment,
    requester,
    requesting,
    requests,
    sense,
)
from tests.brake_request.test_request_frame import DBC, layout, request


def is_requested(alarm: Assessment, speed_m_s: float = 20.0) -> bool:
    core = requester(speed_m_s)
    sense(core, {FCW_ALARM: alarm}, 0.0)
    return bool(requests(core))


def test_a_warning_that_asks_for_no_braking_requests_none() -> None:
    assert is_requested(assessment(value=0.01))
    assert not is_requested(assessment(value=0.0))


def test_an_alarm_whose_level_is_none_does_not_hold_a_request() -> None:
    core = requesting()
    for tenth in range(1, 8):
        now = tenth / 10
        core.host.receive_observation(Speed(now, 20.0, 0.3, "obd"))
        sense(core, {FCW_ALARM: assessment(Level.NONE, 5.5)}, now)

    assert requests(core)[-1].deceleration_m_s2 == 0.0


@pytest.mark.parametrize(("age_s", "requested"), [(OLDEST_S, True), (OLDEST_S + 0.01, False)])
def test_an_observation_is_a_reason_to_brake_up_to_its_greatest_age(
    age_s: float, requested: bool
) -> None:
    assert is_requested(assessment(age_s=age_s)) is requested


def test_the_own_speed_alone_is_no_reason_to_brake() -> None:
    alone = Assessment(Level.WARNING, 5.5, (AlarmReason(Speed.kind, "obd", 0.0),))
    assert not is_requested(alone)


def test_the_lowest_speed_at_which_braking_is_requested() -> None:
    assert is_requested(assessment(), speed_m_s=STANDS_M_S)
    assert not is_requested(assessment(), speed_m_s=STANDS_M_S - 0.01)


@pytest.mark.parametrize(("after_s", "lasts"), [(HOLD_S, True), (HOLD_S + 0.01, False)])
def test_a_request_goes_on_without_its_danger_for_the_time_that_it_is_held(
    after_s: float, lasts: bool
) -> None:
    core = requesting()
    core.host.receive_observation(Speed(after_s, 20.0, 0.3, "obd"))
    sense(core, {FCW_ALARM: NOTHING}, after_s)

    assert (requests(core)[-1].deceleration_m_s2 > 0.0) is lasts


def test_a_request_may_fill_a_frame() -> None:
    whole = DBC.replace("BO_ 801 OTHER: 1 CAR", "BO_ 801 OTHER: 8 CAR")
    frame = layout(whole, deceleration="OTHER.DECELERATION").frame(request())
    assert len(frame.data) == 8
