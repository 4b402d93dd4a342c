"""Requests to brake: when they begin, what they ask for, and when they end."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.brake_request.brake_requester import (
    COUNTER_END,
    HOLD_S,
    OLDEST_S,
    VALIDITY_S,
    BrakeRequest,
    BrakeRequester,
    RequestEvent,
    RequestState,
)
from onboard.brake_request.certainty import dangers
from onboard.brake_request.settings import BrakeRequestSettings
from onboard.observations import Speed
from onboard.risk.alarm import NOTHING, RELEASE_S, AlarmKey, AlarmReason, Assessment, Level
from onboard.risk.eebl import EEBL
from onboard.risk.fcw import FCW
from onboard.risk.ima import IMA
from onboard.risk.lcca_warning import LCCA
from onboard.sensors.host_state import BRAKING_SPEED_VALID_S, HostState

FCW_ALARM: AlarmKey = FCW, ""
IMA_ALARM: AlarmKey = IMA, "7"
LCCA_ALARM: AlarmKey = LCCA, ""
ORIGIN = bytes(8)


def assessment(
    level: Level = Level.WARNING,
    value: float = 5.5,
    *sources: str,
    age_s: float = 0.1,
    vehicle: str = "",
) -> Assessment:
    reasons = [AlarmReason(what, "7", age_s) for what in sources or ("lead",)]
    return Assessment(level, value, (*reasons, AlarmReason("speed", "obd", 0.0)), vehicle)


def requester(speed_m_s: float | None = 20.0, **settings: Any) -> BrakeRequester:
    found = BrakeRequester(BrakeRequestSettings(**settings), HostState())
    if speed_m_s is not None:
        found.host.receive_observation(Speed(0.0, speed_m_s, 0.3, "obd"))
    return found


def sense(core: BrakeRequester, found: Mapping[AlarmKey, Assessment], now: float) -> None:
    """Assess what own sensors show, of which nothing comes by radio."""
    core.assess(found, found, now)


def tell(core: BrakeRequester, found: Mapping[AlarmKey, Assessment], now: float) -> None:
    """Assess what messages tell, of which own sensors show nothing."""
    core.assess(found, {}, now)


def requests(core: BrakeRequester) -> list[BrakeRequest]:
    return list(iter(core.next_event, None))


def last(core: BrakeRequester) -> BrakeRequest:
    return requests(core)[-1]


def requesting(**settings: float) -> BrakeRequester:
    """A requester that has put out one request at 0 s."""
    core = requester(**settings)
    sense(core, {FCW_ALARM: assessment()}, 0.0)
    (begun,) = requests(core)
    assert begun.deceleration_m_s2 == 5.5
    return core


def cause(core: BrakeRequester, event: RequestEvent) -> None:
    """Make `event` happen, at a time when the request of `requesting` is still valid."""
    match event:
        case RequestEvent.CERTAIN:
            sense(core, {FCW_ALARM: assessment()}, 0.1)
        case RequestEvent.LASTING:
            sense(core, {FCW_ALARM: assessment(Level.CAUTION)}, 0.1)
        case RequestEvent.NONE:
            now = HOLD_S + 0.1
            core.host.receive_observation(Speed(now, 20.0, 0.3, "obd"))
            sense(core, {FCW_ALARM: NOTHING}, now)
        case RequestEvent.HOST_STANDS:
            core.host.receive_observation(Speed(0.1, 0.0, 0.3, "obd"))
            sense(core, {FCW_ALARM: assessment()}, 0.1)
        case RequestEvent.UNASSESSED:
            core.handle_timer(VALIDITY_S)


@pytest.mark.parametrize("event", RequestEvent)
@pytest.mark.parametrize("state", RequestState)
def test_every_event_in_every_state(state: RequestState, event: RequestEvent) -> None:
    core = requesting() if state is RequestState.REQUESTING else requester()

    cause(core, event)

    found = requests(core)
    goes_on = event is RequestEvent.CERTAIN or (
        event is RequestEvent.LASTING and state is RequestState.REQUESTING
    )
    if goes_on:
        assert [each.deceleration_m_s2 for each in found] == [5.5]
        assert core.get_timer() == 0.1 + VALIDITY_S
    else:
        ends = 1 if state is RequestState.REQUESTING else 0
        assert [(each.deceleration_m_s2, each.valid_s) for each in found] == [(0.0, 0.0)] * ends
        assert core.get_timer() == float("inf")


def test_a_request_ends_unless_it_is_renewed() -> None:
    core = requesting()

    core.handle_timer(VALIDITY_S - 0.01)
    assert requests(core) == []

    core.handle_timer(VALIDITY_S)
    assert last(core) == BrakeRequest(VALIDITY_S, 0.0, 0.0, 0.0, 1, ())


BY_RADIO = "perceived_object:bsm"


def certainties(
    alarms: Mapping[AlarmKey, Assessment], sensed: Mapping[AlarmKey, Assessment]
) -> dict[bool, float]:
    """Return those of the dangers by whether own sensors show them."""
    found = dangers(alarms, sensed, BrakeRequestSettings())
    return {each.is_sensed: round(each.certainty, 6) for each in found}


@pytest.mark.parametrize("sources", [(BY_RADIO,), ("bsm", "perceived_object:shared", "warning")])
def test_messages_are_one_source_however_many_there_are(sources: tuple[str, ...]) -> None:
    reported = {FCW_ALARM: assessment(Level.WARNING, 5.0, *sources)}

    assert certainties(reported, {}) == {False: 0.8}
    assert certainties({IMA_ALARM: assessment(Level.WARNING, 0.5, *sources)}, {}) == {False: 0.4}


@pytest.mark.parametrize("sources", [("lead",), ("perceived_object:sensor",)])
def test_what_own_sensors_show_is_the_other_source(sources: tuple[str, ...]) -> None:
    sensed = {FCW_ALARM: assessment(Level.WARNING, 5.0, *sources)}

    assert certainties(sensed, sensed) == {True: 0.9}
    sensed = {IMA_ALARM: assessment(Level.WARNING, 0.5, *sources)}
    assert certainties(sensed, sensed) == {True: 0.45}


def test_a_danger_that_both_show_is_more_certain() -> None:
    sensed = {FCW_ALARM: assessment(Level.WARNING, 5.0, "lead")}
    both = {FCW_ALARM: assessment(Level.WARNING, 6.0, "lead", BY_RADIO)}

    assert certainties(both, sensed) == {True: 0.98, False: 0.8}


@pytest.mark.parametrize("sensed_level", [Level.NONE, Level.CAUTION])
def test_a_lead_that_only_messages_say_to_brake_requests_nothing(sensed_level: Level) -> None:
    """A BSM from the place of the camera's lead, its speed falling, braked a car."""
    core = requester()
    alarms = {FCW_ALARM: assessment(Level.WARNING, 6.0, "lead", BY_RADIO)}
    core.assess(alarms, {FCW_ALARM: assessment(sensed_level, 1.0, "lead")}, 0.0)

    assert requests(core) == []


def test_the_braking_requested_is_what_own_sensors_ask_for() -> None:
    core = requester()
    alarms = {FCW_ALARM: assessment(Level.WARNING, 6.0, "lead", BY_RADIO)}
    core.assess(alarms, {FCW_ALARM: assessment(Level.WARNING, 5.1, "lead")}, 0.0)

    found = last(core)
    assert (found.deceleration_m_s2, round(found.certainty, 6)) == (5.1, 0.98)


def test_by_default_radio_alone_requests_nothing() -> None:
    by_radio = {FCW_ALARM: assessment(Level.WARNING, 5.5, "perceived_object:bsm")}
    core, trusting = requester(), requester(least_certainty=0.7)
    for each in (core, trusting):
        tell(each, by_radio, 0.0)

    assert requests(core) == []
    assert last(trusting).certainty == pytest.approx(0.8)


def test_crossing_paths_ask_for_the_configured_braking_if_p_c_is_high() -> None:
    core = requester(least_certainty=0.7, crossing_m_s2=4.0)
    tell(core, {IMA_ALARM: assessment(Level.WARNING, 0.8, "perceived_object:bsm")}, 0.0)
    assert requests(core) == []

    tell(core, {IMA_ALARM: assessment(Level.WARNING, 0.95, "perceived_object:bsm")}, 0.1)

    found = last(core)
    assert (found.deceleration_m_s2, found.causes) == (4.0, (IMA,))
    assert found.certainty == pytest.approx(0.76)


def test_the_hardest_braking_counts_and_is_limited() -> None:
    core = requester()
    sense(core, {FCW_ALARM: assessment(value=3.0), (EEBL, ""): assessment(value=20.0)}, 0.0)

    found = last(core)
    assert found.deceleration_m_s2 == 6.0
    assert found.causes == (EEBL, FCW)


def test_the_request_stays_as_hard_as_ever_while_its_danger_lasts() -> None:
    """Asking for what is still needed, a vehicle crept on at the least speed of FCW_ALARM."""
    core = requesting()
    for tenth in range(1, 20):
        now = tenth / 10.0
        core.host.receive_observation(Speed(now, 20.0, 0.3, "obd"))
        sense(core, {FCW_ALARM: assessment(Level.CAUTION, 0.5)}, now)
        assert last(core).deceleration_m_s2 == 5.5


def test_harder_braking_is_asked_for_at_once() -> None:
    core = requesting()
    sense(core, {FCW_ALARM: assessment(value=5.9)}, 0.05)

    assert last(core).deceleration_m_s2 == 5.9


def test_a_caution_of_another_danger_does_not_prolong_a_request() -> None:
    core = requesting()
    core.host.receive_observation(Speed(0.6, 20.0, 0.3, "obd"))
    sense(core, {IMA_ALARM: assessment(Level.CAUTION, 0.4)}, HOLD_S + 0.1)

    assert last(core).deceleration_m_s2 == 0.0


def test_old_observations_request_nothing() -> None:
    core = requester()
    sense(core, {FCW_ALARM: assessment(age_s=OLDEST_S + 0.01)}, 0.0)

    assert requests(core) == []


@pytest.mark.parametrize("speed", [None, Speed(-BRAKING_SPEED_VALID_S - 0.01, 20.0, 0.3, "obd")])
def test_without_a_host_speed_nothing_is_requested(speed: Speed | None) -> None:
    core = requester(None)
    if speed is not None:
        core.host.receive_observation(speed)
    sense(core, {FCW_ALARM: assessment()}, 0.0)

    assert requests(core) == []


def test_a_warning_of_the_brake_button_requests_nothing() -> None:
    core = requester(least_certainty=0.7)
    real = assessment(Level.WARNING, 4.0, "warning")
    test = replace(real, is_test=True)
    tell(core, {LCCA_ALARM: test}, 0.0)
    assert requests(core) == []

    tell(core, {LCCA_ALARM: real}, 0.1)
    assert last(core).deceleration_m_s2 == 4.0

    tell(core, {LCCA_ALARM: test}, 0.2)
    tell(core, {LCCA_ALARM: test}, 0.2 + HOLD_S)
    assert last(core).deceleration_m_s2 == 0.0


def test_the_counter_wraps() -> None:
    core = requester()
    for _ in range(COUNTER_END + 1):
        sense(core, {FCW_ALARM: assessment()}, 0.0)

    assert [each.counter for each in requests(core)][-3:] == [254, 255, 0]


@given(
    st.lists(
        st.tuples(
            st.sampled_from(Level),
            st.floats(0.0, 20.0),
            st.sampled_from(["lead", "perceived_object:bsm", "warning"]),
            st.floats(0.0, 2.0),
            st.floats(0.0, 30.0),
        ),
        max_size=30,
    )
)
def test_no_request_outlasts_its_alarm_nor_exceeds_its_limits(
    drive: list[tuple[Level, float, str, float, float]],
) -> None:
    core, settings = requester(), BrakeRequestSettings()
    raised_at = -RELEASE_S
    for tenth, (level, value, source, age_s, speed_m_s) in enumerate(drive):
        now = tenth / 10.0
        core.host.receive_observation(Speed(now, speed_m_s, 0.3, "obd"))
        core.handle_timer(now)
        sense(core, {FCW_ALARM: assessment(level, value, source, age_s=age_s)}, now)
        raised_at = raised_at if level is Level.NONE else now
        for each in requests(core):
            assert 0.0 <= each.deceleration_m_s2 <= settings.most_m_s2
            assert 0.0 <= each.certainty <= 1.0
            if each.causes:
                assert now - raised_at < RELEASE_S
                assert each.certainty > 0.0
