"""Events by DENMs: raised, updated and cancelled by who has them; used once by others."""

import math
from dataclasses import replace

import pytest

from onboard.errors import DecodeError
from onboard.its_g5.area import CIRCLE, ELLIPSE, RECTANGLE, is_within
from onboard.its_g5.headers import Area
from onboard.its_g5.notification import EventReports, ReceivedEvents
from onboard.its_g5.stations import HELD_S, Stations
from onboard.messages import denm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_safety import ExteriorLights, VehicleEventFlags, VehicleSafetyExtensions
from onboard.messages.denm import ActionId, Denm, Termination
from onboard.messages.its_common import CauseCode
from tests.its_g5.test_awareness import SENT, UTC_S, received


def bsm(
    *, brakes: bool = False, hazard: bool = False, speed_m_s: float = 13.9
) -> BasicSafetyMessage:
    assert SENT.safety is not None
    safety = replace(
        SENT.safety,
        events=VehicleEventFlags.HARD_BRAKING if brakes else None,
        lights=ExteriorLights.HAZARD_SIGNAL if hazard else None,
    )
    return replace(SENT, core=replace(SENT.core, speed_m_s=speed_m_s), safety=safety)


def reported(reports: EventReports, message: BasicSafetyMessage, utc_s: float) -> list[Denm]:
    """What is reported with a BSM by a clock that is right all the time."""
    return reports.messages(message, utc_s - UTC_S, utc_s)


def braking(utc_s: float = UTC_S) -> Denm:
    (report,) = reported(EventReports(), bsm(brakes=True), utc_s)
    return denm.decode(denm.encode(report))


def changed(message: Denm, **management: object) -> Denm:
    body = message.notification
    new = replace(body.management, **management)  # type: ignore[arg-type]
    return replace(message, notification=replace(body, management=new))


def test_a_braking_is_one_event_updated_and_cancelled() -> None:
    reports = EventReports()
    assert reported(reports, bsm(), UTC_S) == []
    sent = [
        each.notification.management
        for tenth in range(20)
        for each in reported(reports, bsm(brakes=tenth < 10), UTC_S + 0.1 * tenth)
    ]
    assert len(sent) == 11
    assert len({each.action for each in sent}) == 1
    assert [each.termination for each in sent] == [None] * 10 + [Termination.CANCELLATION]
    times = [each.reference_s for each in sent]
    assert times == sorted(set(times))
    (again,) = reported(reports, bsm(brakes=True), UTC_S + 5.0)
    assert again.notification.management.action != sent[0].action


@pytest.mark.parametrize("set_by_s", [-3600.0, 3600.0])
def test_a_clock_that_is_set_changes_no_interval(set_by_s: float) -> None:
    """Nor does it begin or end an event."""
    reports, stands = EventReports(), bsm(brakes=True, hazard=True, speed_m_s=0.0)
    messages = [
        each
        for tenth in range(290)
        for each in reports.messages(stands, tenth / 10, UTC_S + set_by_s * (tenth >= 5))
    ]
    assert len(messages) == 290
    assert {each.notification.situation.event.cause for each in messages} == {99}  # type: ignore[union-attr]


def test_a_new_pseudonym_has_a_new_event_and_no_end_of_the_old_one() -> None:
    reports = EventReports()
    (first,) = reported(reports, bsm(brakes=True), UTC_S)
    other = bsm(brakes=True)
    other = replace(other, core=replace(other.core, temporary_id=b"next"))
    (second,) = reported(reports, other, UTC_S + 0.1)
    assert second.notification.management.action.station_id == b"next"
    assert second.station_id != first.station_id


def test_a_vehicle_that_stands_with_its_hazard_signal_says_so_once_a_second() -> None:
    reports = EventReports()
    sent = [
        (tenth / 10, each)
        for tenth in range(400)
        for each in reported(reports, bsm(hazard=True, speed_m_s=0.0), UTC_S + tenth / 10)
    ]
    assert [at for at, _ in sent] == pytest.approx([30.0 + n for n in range(10)], abs=0.11)
    assert {
        each.notification.situation.event.cause for _, each in sent if each.notification.situation
    } == {94}
    (end,) = reported(reports, bsm(hazard=True, speed_m_s=3.0), UTC_S + 40.0)
    assert end.notification.management.termination is Termination.CANCELLATION


def test_a_received_braking_is_the_bsm_of_its_vehicle_with_the_flag() -> None:
    found = ReceivedEvents().bsm_of(braking(), None, UTC_S + 0.01)
    assert found is not None
    assert found.safety is not None
    assert found.safety.events is VehicleEventFlags.HARD_BRAKING
    assert found.core.temporary_id == SENT.core.temporary_id
    assert found.core.latitude_deg == pytest.approx(25.0330)
    assert found.core.speed_m_s == pytest.approx(13.9)
    assert found.core.heading_rad == pytest.approx(SENT.core.heading_rad, abs=1e-3)
    assert found.core.sec_mark_s == pytest.approx(UTC_S % 60.0, abs=2e-3)
    assert found.safety.path_history is not None
    assert len(found.safety.path_history.crumb_data) == 5


def test_a_standing_vehicle_stands() -> None:
    reports = EventReports()
    reported(reports, bsm(hazard=True, speed_m_s=0.0), UTC_S - 31.0)
    (sent,) = reported(reports, bsm(hazard=True, speed_m_s=0.0), UTC_S)
    found = ReceivedEvents().bsm_of(sent, None, UTC_S)
    assert found is not None
    assert found.safety is not None
    assert (found.core.speed_m_s, found.safety.lights) == (0.0, ExteriorLights.HAZARD_SIGNAL)


def test_a_standing_vehicle_stands_at_each_repetition_until_the_end() -> None:
    """Other stations repeat one report for minutes; who comes late hears of it first then."""
    reports = EventReports()
    reported(reports, bsm(hazard=True, speed_m_s=0.0), UTC_S - 31.0)
    (sent,) = reported(reports, bsm(hazard=True, speed_m_s=0.0), UTC_S)
    repeated, events = changed(sent, validity_s=600.0), ReceivedEvents()
    for after_s in (0.0, 1.0, 29.0, 40.0, 75.0, 599.0):
        for receiver in (events, ReceivedEvents()):
            found = receiver.bsm_of(repeated, None, UTC_S + after_s)
            assert found is not None
            assert found.core.sec_mark_s == pytest.approx((UTC_S + after_s) % 60.0, abs=2e-3)
    end = changed(repeated, termination=Termination.CANCELLATION)
    assert events.bsm_of(end, None, UTC_S + 80.0) is None
    assert events.bsm_of(repeated, None, UTC_S + 81.0) is None


def test_a_repetition_says_nothing_new_however_long_it_is_valid() -> None:
    """A DENM without end: valid for a day and repeated, it is one braking."""
    events, endless = ReceivedEvents(), changed(braking(), validity_s=86_400.0)
    assert events.bsm_of(endless, None, UTC_S) is not None
    for second in range(1, 100):
        assert events.bsm_of(endless, None, UTC_S + second) is None
    updated_s = endless.notification.management.reference_s + 99.0
    later = changed(endless, detected_s=updated_s, reference_s=updated_s)
    assert events.bsm_of(later, None, UTC_S + 100.0) is not None


def test_a_braking_that_must_be_over_is_not_used() -> None:
    """A minute later its time within the minute would be that of a braking now."""
    endless = changed(braking(), validity_s=86_400.0)
    assert ReceivedEvents().bsm_of(endless, None, UTC_S + 60.0) is None


def test_who_reports_another_s_event_first_does_not_hide_it() -> None:
    events, true = ReceivedEvents(), braking()
    ahead = changed(true, reference_s=true.notification.management.reference_s + 1.5)
    assert events.bsm_of(ahead, b"insider-", UTC_S) is not None
    assert events.bsm_of(true, b"true one", UTC_S) is not None


def test_events_that_cannot_be_are_refused_with_the_reason() -> None:
    message = braking()
    management = message.notification.management
    cases = {
        "expired": (message, UTC_S + 2.1),
        "contradictory_times": (changed(message, detected_s=management.detected_s + 1), UTC_S),
        "another_origin": (changed(message, action=ActionId(b"else", 1)), UTC_S),
    }
    for reason, (each, utc_s) in cases.items():
        with pytest.raises(DecodeError) as refused:
            ReceivedEvents().bsm_of(each, None, utc_s)
        assert refused.value.reason == reason
    with pytest.raises(DecodeError, match="ahead"):
        ReceivedEvents().bsm_of(message, None, UTC_S - 3.0)


def test_ends_and_other_events_are_not_used() -> None:
    message = braking()
    body = message.notification
    assert body.situation is not None
    end = changed(message, termination=Termination.CANCELLATION)
    fog = replace(body.situation, event=CauseCode(18))
    for each in (end, replace(message, notification=replace(body, situation=fog))):
        assert ReceivedEvents().bsm_of(each, None, UTC_S) is None


def test_between_low_frequency_containers_the_path_stays_where_it_was() -> None:
    stations, whole = Stations(), received(SENT)
    stations.receive_whole(whole, b"signer", UTC_S)
    core = replace(whole.core, latitude_deg=25.0330 + 1e-4)
    bare = BasicSafetyMessage(core, VehicleSafetyExtensions())
    found = stations.completed(bare, b"signer", UTC_S + 0.3).safety
    assert found is not None
    assert found.path_history is not None
    assert whole.safety is not None
    assert whole.safety.path_history is not None
    for one, other in zip(
        whole.safety.path_history.crumb_data, found.path_history.crumb_data, strict=True
    ):
        assert other.latitude_offset_deg == pytest.approx(
            (one.latitude_offset_deg or 0.0) - 1e-4, abs=5e-7
        )
    assert stations.completed(bare, b"another", UTC_S + 0.3) == bare
    assert stations.completed(bare, b"signer", UTC_S + HELD_S + 0.1) == bare


@pytest.mark.parametrize(
    ("shape", "inside"), [(CIRCLE, {0, 90, 45}), (RECTANGLE, {0}), (ELLIPSE, {0})]
)
def test_areas_are_those_of_their_shape(shape: int, inside: set[int]) -> None:
    """190 m in three directions: 200 m to the north is the long half axis, 50 m the short one."""
    area = Area(48.0, 11.0, 200, 50, 0)
    found = set()
    for direction in (0, 45, 90):
        north_deg = 48.0 + 190.0 * math.cos(math.radians(direction)) / 111_195
        east_m = 190.0 * math.sin(math.radians(direction))
        if is_within(area, shape, north_deg, 11.0 + east_m / 111_195 / math.cos(math.radians(48))):
            found.add(direction)
    assert found == inside
    assert not is_within(Area(48.0, 11.0, 0), shape, 48.0, 11.0)
