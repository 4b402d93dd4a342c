"""Sharing in SDSMs: what is sent, what is used, and that nothing counts twice beside footers."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from onboard.messages import sdsm
from onboard.messages.date_time import DateTime
from onboard.messages.map_data import ReferencePoint
from onboard.messages.sdsm import EquipmentType, ObjectType
from onboard.mvs.received_footers import evidence_in
from onboard.mvs.sdsm_coding import SIGMAS_IN_95_PERCENT, entries_in
from onboard.mvs.settings import SharedIn
from onboard.tracking.evidence import observer_of
from tests.mvs.world import EXACT, Car, World, assert_lists_each_measurement_once, only, ring
from tests.typed import a


def two_and_one(shared_in: SharedIn, **changes: Any) -> World:
    """Return a world in which a sees x, which has no radio, and tells b."""
    cars = [
        Car("a", 0.0, 0.0, vy_m_s=10.0, sees=frozenset({"x"})),
        Car("b", 60.0, 40.0, vy_m_s=10.0),
        Car("x", 0.0, 25.0, vy_m_s=10.0, radio=False),
    ]
    return World(cars, settings=EXACT.model_copy(update={"shared_in": shared_in}), **changes)


def last_sdsm(world: World) -> sdsm.SensorDataSharingMessage:
    return sdsm.decode(next(each.sdsm for each in reversed(world.sent) if each.sdsm is not None))


@pytest.mark.parametrize("shared_in", SharedIn)
def test_a_vehicle_without_radio_is_known_by_what_another_vehicle_shares(
    shared_in: SharedIn,
) -> None:
    world = two_and_one(shared_in)
    world.run(2.0)

    x = only(world.without_radio("b"))
    assert {observer_of(each) for each in x.provenance} == {world.car("a").id}
    assert np.abs(world.place_of("b", x) - world.truth("x"))[:2].max() < 1.5
    assert world.discarded("b") == []


def test_an_object_states_position_velocity_time_and_accuracy() -> None:
    world = two_and_one(SharedIn.SDSM)
    world.run(2.0)

    message = last_sdsm(world)
    assert (message.source_id, message.equipment) == (world.car("a").id, EquipmentType.OBU)
    (each,) = message.objects
    car = each.common
    assert car.type is ObjectType.VEHICLE
    assert (car.offset.east_m, car.offset.north_m) == pytest.approx((0.0, 25.0), abs=1.5)
    assert car.speed_m_s == pytest.approx(10.0, abs=1.5)
    assert abs(math.remainder(a(float, car.heading_rad), math.tau)) < 0.2
    measured_ms = message.time.utc_ms(round(world.t * 1000)) + car.measurement_time_ms
    assert 0 <= world.t * 1000 - measured_ms <= 201
    assert car.confidence.position_m in {1.0, 2.0}  # 95 % of a sigma of about 0.45 m


def test_footer_and_sdsm_of_one_sender_name_the_same_measurements() -> None:
    world = two_and_one(SharedIn.BOTH)
    for _ in range(10):
        world.run(0.2)
        assert_lists_each_measurement_once(world)
    both, footer_only = only(world.without_radio("b")), two_and_one(SharedIn.FOOTER)
    footer_only.run(2.0)
    assert len(both.provenance) == len(only(footer_only.without_radio("b")).provenance)
    assert both.covariance == only(footer_only.without_radio("b")).covariance


@pytest.mark.parametrize(
    "shared_in", [SharedIn.SDSM, pytest.param(SharedIn.BOTH, marks=pytest.mark.long)]
)
def test_evidence_in_circles_is_used_once(shared_in: SharedIn) -> None:
    world = ring(4, settings=EXACT.model_copy(update={"shared_in": shared_in}))
    for _ in range(10):
        world.run(0.2)
        assert_lists_each_measurement_once(world)
    for k in range(4):
        x = only(world.without_radio(f"c{k}"))
        assert {observer_of(each) for each in x.provenance} == {car.id for car in world.with_radio}


def test_nothing_is_sent_again_and_nothing_without_own_measurements() -> None:
    world = two_and_one(SharedIn.SDSM)
    world.run(1.0)
    sent = [each.sdsm is not None for each in world.sent if each.sender.name == "b"]
    assert not any(sent)  # b measures nothing
    world.car("a").sees = frozenset()
    world.run(0.5)
    assert not any(each.sdsm is not None for each in world.sent[-4:])


def test_a_road_side_unit_without_bsms_is_placed_by_its_message() -> None:
    world = two_and_one(SharedIn.SDSM)
    world.run(2.0)
    message, b = last_sdsm(world), world.mvs["b"]
    unit = replace(message, source_id=b"unit", equipment=EquipmentType.RSU)
    car = replace(message, source_id=b"ghst")
    world.discarded("b")
    b.receive_sdsm(unit, world.t)
    assert world.discarded("b") == []
    b.receive_sdsm(car, world.t)
    far = replace(unit, source_id=b"far-", reference=ReferencePoint(49.0, 11.5))
    b.receive_sdsm(far, world.t)
    assert world.discarded("b") == ["unplaced_sender", "sender_far"]
    for _ in range(5):
        world.run(0.1)
        b.receive_sdsm(
            replace(last_sdsm(world), source_id=b"unit", equipment=unit.equipment), world.t
        )
    assert b"unit" in {observer_of(each) for each in only(world.without_radio("b")).provenance}


def test_a_sender_is_heard_at_twice_the_rate_of_bsms_at_most() -> None:
    world = two_and_one(SharedIn.SDSM)
    world.run(2.0)
    unit = replace(last_sdsm(world), source_id=b"unit", equipment=EquipmentType.RSU)
    world.discarded("b")
    for _ in range(50):
        world.mvs["b"].receive_sdsm(unit, world.t)
    assert world.discarded("b") == ["too_often"] * 42


def test_own_messages_and_what_has_no_time_or_place_are_discarded() -> None:
    world = two_and_one(SharedIn.SDSM)
    world.run(2.0)
    message, b = last_sdsm(world), world.mvs["b"]
    world.discarded("b")
    b.receive_sdsm(replace(message, source_id=world.car("b").id), world.t)
    b.receive_sdsm(replace(message, time=DateTime(2026)), world.t)
    b.receive_sdsm(replace(message, reference=ReferencePoint(None, None)), world.t)
    late = DateTime.of_utc(round(world.t * 1000) - 60_000)
    b.receive_sdsm(replace(message, time=late), world.t)
    b.update(world.t)
    assert world.discarded("b") == ["own_message", "no_time", "no_position", "stale"]


def test_what_was_measured_before_1970_is_discarded_whoever_says_so() -> None:
    world = two_and_one(SharedIn.SDSM)
    world.run(2.0)
    message, b = last_sdsm(world), world.mvs["b"]
    world.discarded("b")
    unit = replace(message, source_id=bytes(4), equipment=EquipmentType.RSU)
    for time in (DateTime(1, 1, 1, 1, 1, 1.0), DateTime(1969, 12, 31, 23, 59, 59.999)):
        b.receive_sdsm(replace(unit, time=time), world.t)
    b.update(world.t)
    assert world.discarded("b") == ["out_of_range"] * 2


def test_only_vehicles_with_a_confidence_are_used() -> None:
    world = two_and_one(SharedIn.SDSM)
    world.run(2.0)
    message = last_sdsm(world)
    (car,) = message.objects
    unsure = replace(car, common=replace(car.common, confidence=sdsm.PositionConfidenceSet()))
    person = replace(car, common=replace(car.common, type=ObjectType.VRU))
    entries = entries_in(replace(message, objects=(unsure, person, car)), round(world.t * 1000))
    assert len(entries) == 1
    bound_m = car.common.confidence.position_m
    assert bound_m is not None
    sigma_m = bound_m / SIGMAS_IN_95_PERCENT
    (piece,) = evidence_in(entries, entries.anchor)
    assert piece.covariance == pytest.approx(np.eye(2) * sigma_m**2)


def test_the_count_begins_anew_with_each_pseudonym() -> None:
    world = two_and_one(SharedIn.SDSM)
    world.run(2.0)
    a, before = world.mvs["a"], last_sdsm(world).msg_cnt
    assert before != b"\xc8new"[0] % 128
    a.set_own_id(b"\xc8new")
    world.car("a").name = "\xc8new"  # its BSMs and messages bear one ID
    message = None
    while message is None:
        world.t += 0.1
        car = world.car("\xc8new")
        a.receive_position(world.fix(car, world.truth(car.name)))
        a.receive_detection(world.seen(car, world.truth(car.name), world.car("x"), 2))
        message = a.sdsm_to_send(world.t)
    assert message.msg_cnt == 0xC8 % 128
