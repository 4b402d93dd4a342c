"""Sharing in CPMs: what is sent and when, what is used, and that nothing counts twice."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import cpm
from onboard.messages.cpm import CollectivePerceptionMessage, PerceivedObjectContainer
from onboard.messages.cpm_evidence import ESTIMATE
from onboard.messages.cpm_object import (
    CartesianVelocity,
    Coordinate,
    CpmObject,
    ObjectClass,
)
from onboard.messages.fields import Chosen
from onboard.messages.its_common import ReferencePosition
from onboard.messages.mvs_footer import ObserverRun
from onboard.mvs.cpm_coding import BOUND_SIGMAS, SharedObject, encode_within, entries_in
from onboard.mvs.sdsm_coding import Sender
from onboard.mvs.sent_evidence import SentOfTrack
from onboard.tracking.evidence import (
    Estimate,
    Measurement,
    measured_ms,
    measurement_id,
    observer_of,
)
from tests.messages.test_cpm import NAME, ORACLE
from tests.mvs.world import EXACT, Car, World, assert_lists_each_measurement_once, only, ring

UTC_S = 1_790_000_000.0
"""TimestampIts has nothing before 2004."""


def two_and_one(**changes: Any) -> World:
    """Return a world in which a sees x, which has no radio, and b does not."""
    cars = [
        Car("a", 0.0, 0.0, vy_m_s=10.0, sees=frozenset({"x"})),
        Car("b", 60.0, 40.0, vy_m_s=10.0),
        Car("x", 0.0, 25.0, vy_m_s=10.0, radio=False),
    ]
    return World(cars, settings=EXACT, by_cpm=True, t=UTC_S, **changes)


def last_cpm(world: World, name: str = "a") -> CollectivePerceptionMessage:
    sent = [each.cpm for each in world.sent if each.sender.name == name]
    return cpm.decode(next(each for each in reversed(sent) if each is not None))


def plain(message: CollectivePerceptionMessage, **changes: Any) -> CollectivePerceptionMessage:
    """As one of another make, without what MVS adds."""
    objects = tuple(replace(each, **changes) for each in message.perceived.objects)
    return replace(message, perceived=replace(message.perceived, objects=objects, evidence=None))


def test_a_vehicle_without_radio_is_known_by_what_another_vehicle_shares() -> None:
    world = two_and_one()
    world.run(2.0)

    x = only(world.without_radio("b"))
    assert {observer_of(each) for each in x.provenance} == {world.car("a").id}
    assert np.abs(world.place_of("b", x) - world.truth("x"))[:2].max() < 1.5
    assert world.discarded("b") == []


def test_a_vehicle_is_due_when_it_is_new_has_changed_or_was_not_sent_for_a_second() -> None:
    def estimate(east_m: float, speed_m_s: float, turned_rad: float = 0.0) -> Estimate:
        velocity = speed_m_s * math.sin(turned_rad), speed_m_s * math.cos(turned_rad)
        return Estimate(frozenset(), np.array([east_m, 0.0, *velocity]), np.eye(4), 1, 1)

    sent = SentOfTrack()
    assert sent.is_due(estimate(0.0, 10.0), 5000)
    sent.state, sent.footer_ms = estimate(0.0, 10.0).state, 5000
    assert [
        sent.is_due(now, 5900)
        for now in (
            estimate(3.9, 10.4, 0.06),
            estimate(4.1, 10.0),
            estimate(0.0, 10.6),
            estimate(0.0, 10.0, 0.08),
        )
    ] == [False, True, True, True]
    assert sent.is_due(estimate(0.0, 10.0), 6000)
    sent.state = estimate(0.0, 0.3).state
    assert not sent.is_due(estimate(0.0, 0.3, 1.0), 5900)


def test_vehicles_are_sent_less_often_than_they_are_measured_and_no_measurement_is_lost() -> None:
    world = two_and_one()
    world.run(2.0)
    sent = [cpm.decode(each.cpm) for each in world.sent if each.cpm and each.sender.name == "a"]
    assert 5 <= len(sent) <= 15  # of 20 pictures
    ages = [
        age
        for message in sent[-5:]
        if message.perceived.evidence is not None
        for piece in message.perceived.evidence.pieces
        if piece.name == ESTIMATE
        for run in piece.value.runs
        for age in run.ages_ms
    ]
    assert len(ages) >= 10


def test_an_object_states_what_other_makes_read() -> None:
    world = two_and_one()
    world.run(2.0)

    message = last_cpm(world)
    assert message.station_id == world.car("a").id
    assert message.orientation is not None
    (each,) = message.perceived.objects
    assert each.is_vehicle
    assert -201 <= each.measurement_delta_time_ms <= 0
    place_m = each.position.east.value_m, each.position.north.value_m
    assert place_m == pytest.approx((0.0, 25.0), abs=1.5)
    assert each.velocity is not None
    velocity = each.velocity.value
    assert isinstance(velocity, CartesianVelocity)
    assert velocity.north.value_m_s == pytest.approx(10.0, abs=2.0)
    evidence = message.perceived.evidence
    assert evidence is not None
    assert evidence.pieces[0].name == ESTIMATE  # of what was measured since the last message
    bound_m = each.position.north.confidence_m
    assert bound_m is not None
    assert bound_m >= BOUND_SIGMAS * evidence.pieces[0].value.sigma_north_m - 0.02


@pytest.mark.long
def test_evidence_in_circles_is_used_once() -> None:
    world = ring(4, settings=EXACT, by_cpm=True, t=UTC_S)
    for _ in range(15):
        world.run(0.2)
        assert_lists_each_measurement_once(world)
    for k in range(4):
        x = only(world.without_radio(f"c{k}"))
        assert {observer_of(each) for each in x.provenance} == {car.id for car in world.with_radio}


def test_a_message_of_another_make_is_a_measurement_of_its_sender_and_counts_once() -> None:
    world = two_and_one()
    world.run(2.0)
    b, message = world.mvs["b"], last_cpm(world)
    (each,) = message.perceived.objects
    entries = entries_in(plain(message))
    (identity,) = entries.provenances[0]
    assert observer_of(identity) == message.station_id
    assert 0 <= round(world.t * 1000) - measured_ms(identity) < 1000
    assert not entries.has_speed.any()
    bounds_m = each.position.east.confidence_m, each.position.north.confidence_m
    sigma_m = math.hypot(*(bound_m or 0.0 for bound_m in bounds_m)) / BOUND_SIGMAS
    assert entries.covariances[0, :2, :2] == pytest.approx(np.eye(2) * sigma_m**2)

    before = only(world.without_radio("b"))
    b.receive_cpm(message, world.t)
    b.receive_cpm(plain(message), world.t)
    assert only(world.without_radio("b")).provenance == before.provenance
    assert_lists_each_measurement_once(world)


def test_what_another_make_knows_only_from_others_or_without_a_bound_is_not_used() -> None:
    world = two_and_one()
    world.run(2.0)
    message = last_cpm(world)
    (each,) = message.perceived.objects
    unsure = replace(each.position, east=Coordinate(1.0, None))
    beyond = replace(each.position, east=Coordinate(1.0, 40.95))
    person = (ObjectClass(Chosen("vru", Chosen("pedestrian", None)), 90),)
    for change in (
        {"quality": 0}, {"position": unsure}, {"position": beyond}, {"classes": person}
    ):  # fmt: skip
        assert len(entries_in(plain(message, **change))) == 0
    assert len(entries_in(plain(message, quality=1, object_id=None))) == 1


def test_who_passes_on_what_others_measure_says_so() -> None:
    world = two_and_one()
    world.run(2.0)
    (measured,), (passed_on,) = (last_cpm(world, name).perceived.objects for name in ("a", "b"))
    assert (measured.quality, passed_on.quality) == (None, 0)


def test_a_road_side_unit_without_cams_is_placed_by_its_message() -> None:
    world = two_and_one()
    world.run(2.0)
    message, b = plain(last_cpm(world)), world.mvs["b"]
    world.discarded("b")
    unit = replace(message, station_id=b"unit", orientation=None, is_road_side_unit=True)
    b.receive_cpm(unit, world.t)
    assert world.discarded("b") == []
    b.receive_cpm(replace(message, station_id=b"ghst"), world.t)
    far = replace(message.management, position=ReferencePosition(49.0, 11.5))
    b.receive_cpm(replace(unit, station_id=b"far-", management=far), world.t)
    assert world.discarded("b") == ["unplaced_sender", "sender_far"]


def test_evidence_that_contradicts_its_object_is_refused() -> None:
    world = two_and_one()
    world.run(2.0)
    message, b = last_cpm(world), world.mvs["b"]
    evidence, (each,) = message.perceived.evidence, message.perceived.objects
    assert evidence is not None
    world.discarded("b")

    def receives(changed: CpmObject = each, **changes: Any) -> list[str]:
        piece = Chosen(ESTIMATE, replace(evidence.pieces[0].value, **changes))
        altered = replace(evidence, pieces=(piece,))
        perceived = replace(message.perceived, objects=(changed,), evidence=altered)
        b.receive_cpm(replace(message, perceived=perceived), world.t)
        return world.discarded("b")

    (run,) = evidence.pieces[0].value.runs
    assert receives() == []
    assert receives(replace(each, velocity=None)) == ["contradictory_containers"]
    assert receives(replace(each, measurement_delta_time_ms=5)) == ["contradictory_containers"]
    assert receives(runs=(run, run)) == ["repeated_measurement"]
    assert receives(runs=(ObserverRun(9, (1,)),)) == ["unknown_observer"]
    nowhere = replace(message.management, position=ReferencePosition())
    b.receive_cpm(replace(message, management=nowhere), world.t)
    b.receive_cpm(replace(message, station_id=world.car("b").id), world.t)
    assert world.discarded("b") == ["no_position", "own_message"]


def test_255_objects_are_too_many_and_a_message_in_bits_too_few_carries_fewer() -> None:
    world = two_and_one()
    world.run(2.0)
    message, b = plain(last_cpm(world)), world.mvs["b"]
    (each,) = message.perceived.objects
    objects = tuple(replace(each, object_id=number) for number in range(255))
    full = replace(message.perceived, number_of_objects=255, objects=objects)
    world.discarded("b")
    b.receive_cpm(replace(message, perceived=full), world.t)
    b.update(world.t)
    assert world.discarded("b") == ["too_many_entries"]


def test_of_300_objects_a_message_has_the_first_that_fit_and_says_that_there_are_more() -> None:
    here, now_ms = LocalFrame(48.0, 11.0), round(UTC_S * 1e3)
    sender = Sender(b"aaaa", here, 0.5, 0.0)
    objects = [
        SharedObject(
            number,
            Measurement(
                measurement_id(b"aaaa", now_ms - number % 100), np.full(2, 0.1 * number), np.eye(2)
            ),
            np.zeros(2),
            1.0,
            is_sensed=True,
        )
        for number in range(300)
    ]
    message, fitting = encode_within(objects, sender, now_ms, here, 1000, perceived=300)
    data = cpm.encode(message)
    assert len(fitting) > 20
    assert fitting == objects[: len(fitting)]
    assert len(data) <= 1000
    one_more, _ = encode_within(
        objects[: len(fitting) + 1], sender, now_ms, here, 2000, perceived=300
    )
    assert len(cpm.encode(one_more)) > 1000

    theirs = ORACLE.decode(NAME, data)["payload"]["cpmContainers"][-1]
    container = ORACLE.decode("PerceivedObjectContainer", theirs["containerData"])
    assert container["numberOfPerceivedObjects"] == 255, "the most that it can say"
    listed = [each["objectId"] for each in container["perceivedObjects"]]
    assert listed == list(range(len(fitting)))


def test_all_eight_segments_of_what_a_road_side_unit_perceives_are_used() -> None:
    """They arrive together, with one reference time."""
    world = two_and_one()
    world.run(2.0)
    for _ in range(6):
        world.run(0.5)
        message = plain(last_cpm(world))
        (each,) = message.perceived.objects
        unit = replace(message, station_id=b"unit", orientation=None, is_road_side_unit=True)
        theirs = ORACLE.decode(NAME, cpm.encode(unit))
        payload = theirs["payload"]
        for part in range(1, 9):
            north = Coordinate((each.position.north.value_m or 0.0) + 20.0 * part, 0.5)
            alone = replace(each, object_id=part, position=replace(each.position, north=north))
            perceived = PerceivedObjectContainer(8, (alone,))
            segment = {"totalMsgNo": 8, "thisMsgNo": part}
            payload["managementContainer"]["segmentationInfo"] = segment
            payload["cpmContainers"][-1]["containerData"] = cpm.OBJECTS.encode(perceived)
            world.mvs["b"].receive_cpm(cpm.decode(ORACLE.encode(NAME, theirs)), world.t)
    world.mvs["b"].update(world.t)
    assert world.discarded("b") == []
    places_m = [world.place_of("b", track)[1] for track in world.without_radio("b")]
    for part in range(1, 9):
        expected_m = world.truth("x")[1] + 20.0 * part
        assert any(abs(place_m - expected_m) < 4.0 for place_m in places_m), places_m
