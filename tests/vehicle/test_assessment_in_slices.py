"""Many vehicles are assessed in slices, between which a vehicle receives; it decides as at once."""

import pytest

from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData, PositionalAccuracy
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.observations import Position, Speed
from onboard.risk.alarm import Alarm, Level
from onboard.risk.fcw import FCW
from onboard.trace.trace_line import Event
from onboard.vehicle import surroundings
from onboard.vehicle.surroundings import ASSESSMENT_INTERVAL_S, OBJECTS_AT_ONCE
from onboard.vehicle.vehicle import Vehicle
from tests.vehicle.test_vehicle import UTC_S, vehicle

LATITUDE_DEG, LONGITUDE_DEG, METRES_PER_DEGREE = 48.1, 11.5, 111_200.0
OWN_M_S, STANDS_M = 20.0, 70.0


def bsm(number: int, now: float) -> BasicSafetyMessage:
    """Vehicle 0 stands ahead; the others drive far beside the road."""
    ahead_m = STANDS_M if number == 0 else OWN_M_S * now + 10.0 * number
    aside_m = 0.0 if number == 0 else 60.0
    core = CoreData(
        round(now * 10) % 128,
        number.to_bytes(4),
        sec_mark_s=round((UTC_S + now) % 60.0, 3),
        latitude_deg=LATITUDE_DEG + ahead_m / METRES_PER_DEGREE,
        longitude_deg=LONGITUDE_DEG + aside_m / METRES_PER_DEGREE,
        accuracy=PositionalAccuracy(0.5, 0.5, 0.0),
        speed_m_s=0.0 if number == 0 else OWN_M_S,
        heading_rad=0.0,
    )
    return BasicSafetyMessage(core)


def receive(of: Vehicle, now: float, others: int) -> None:
    latitude_deg = LATITUDE_DEG + OWN_M_S * now / METRES_PER_DEGREE
    of.receive_observation(Speed(now, OWN_M_S, 0.01, "dbc"), now)
    of.receive_observation(Position(now, latitude_deg, LONGITUDE_DEG, None, 0.5, OWN_M_S, 0.0), now)
    for number in range(others):
        of.receive_message(bsm(number, now), None, now, now)


def drive(others: int) -> tuple[list[Event], int]:
    """Return what was put out, and the most steps that an assessment took."""
    of, events, most = vehicle("AAA1"), list[Event](), 0
    for tick in range(15):
        now = tick * ASSESSMENT_INTERVAL_S + 0.01
        receive(of, now, others)
        steps = 0
        while of.get_timer() <= now:
            of.handle_timer(now)
            list(of.messages_to_send(now))
            steps += 1
        most = max(most, steps)
        events += iter(of.next_event, None)
    return events, most


def test_many_vehicles_are_assessed_in_slices_as_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    events, steps = drive(OBJECTS_AT_ONCE + 8)
    monkeypatch.setattr(surroundings, "OBJECTS_AT_ONCE", 2 * OBJECTS_AT_ONCE)
    at_once, together = drive(OBJECTS_AT_ONCE + 8)

    assert steps >= together + 8
    assert events == at_once
    assert any(
        isinstance(each, Alarm) and (each.cause, each.level) == (FCW, Level.WARNING)
        for each in events
    )


def test_what_is_received_between_two_slices_belongs_to_the_next_assessment() -> None:
    of, now = vehicle("AAA1"), 0.01
    receive(of, now, OBJECTS_AT_ONCE + 8)
    for _ in range(2):
        of.handle_timer(now)
    host, objects = of.surroundings
    receive(of, now + 0.05, OBJECTS_AT_ONCE + 16)
    while of.get_timer() <= now + 0.05:
        of.handle_timer(now + 0.05)
        list(of.messages_to_send(now + 0.05))

    assert len(objects) == OBJECTS_AT_ONCE + 8
    assert of.surroundings == (host, objects)


def test_what_fails_in_an_assessment_keeps_nothing_else_from_its_turn_before_the_next_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    of = vehicle("AAA1")
    receive(of, 0.01, 1)
    with monkeypatch.context() as broken:
        broken.setattr(MultiVehicleSensing, "kinematic_info_in_slices", lambda *_: 1 // 0)
        with pytest.raises(ZeroDivisionError):
            of.handle_timer(0.01)
        of.handle_timer(0.02)
    receive(of, 0.12, 1)
    of.handle_timer(0.12)
    _, others = of.surroundings
    assert len(others) == 1
