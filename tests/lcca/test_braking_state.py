"""A braking is told while it lasts, and its end too."""

from dataclasses import replace
from functools import partial

from onboard.lcca.events import MeasuredLead, WarningLevel, WarningOver, WarningRaised
from onboard.lcca.transitions import GroupState
from onboard.messages.lcca import Warn, WarnCause
from onboard.observations import BrakeCause
from tests.lcca.one_car import A, OneCar, answer
from tests.lcca.road import Air, Car, Road, Transmission, car_id
from tests.lcca.rows import row
from tests.typed import a


def braking_ahead(car: Car) -> list[str]:
    """What the car's driver is told of brakings ahead."""
    kinds = (WarningRaised, WarningLevel, WarningOver)
    return [event.kind for event in car.said if isinstance(event, kinds)]


def test_a_vehicle_that_joins_long_after_the_onset_is_warned_while_the_braking_lasts() -> None:
    road = Road()
    road.add("A", 0.0)
    late = road.add("B", -10.0, lane=1)
    road.run(3.0)
    road.brake("A")
    road.run(10.0)
    late.lane = 0
    began = road.now
    road.run(0.5)
    assert late.group.state is GroupState.MEMBER
    (warning,) = late.warnings
    joined_at = late.transitions[-1].stamp_s
    assert warning.stamp_s - joined_at < 0.05
    assert began < joined_at


def test_a_vehicle_that_joins_after_the_end_is_not_warned() -> None:
    road = Road()
    road.add("A", 0.0)
    late = road.add("B", -10.0, lane=1)
    road.run(3.0)
    road.brake("A")
    road.run(1.0)
    road.release("A")
    late.lane = 0
    road.run(2.0)
    assert late.group.state is GroupState.MEMBER
    assert road.warns() == []


def test_the_end_of_a_braking_reaches_all_and_a_second_braking_warns_anew() -> None:
    road = row("ABCDE", Air(reach_m=45.0))
    for _ in range(2):
        road.brake("A")
        road.run(1.5)
        road.release("A")
        road.run(0.5)
    for name in "BCDE":
        assert braking_ahead(road.cars[name]) == ["warning", "warning_over"] * 2


def test_a_harder_braking_is_a_level_of_the_same_one() -> None:
    road = row("ABC")
    road.brake("A", 5.0)
    road.run(0.3)
    road.brake("A", 5.4)
    road.run(0.3)
    road.brake("A", 9.0)
    road.run(0.3)
    road.brake("A", 60.0, BrakeCause.COLLISION)
    road.run(0.3)
    assert braking_ahead(road.cars["C"]) == ["warning", "warning_level", "warning_level"]
    level = a(WarningLevel, road.cars["C"].said[-1])
    assert level.deceleration_m_s2 == 25.5
    assert level.cause is BrakeCause.COLLISION


def test_a_braking_lasts_for_those_behind_as_long_as_it_lasts() -> None:
    road = row("ABC")
    road.brake("A")
    road.run(30.0)
    assert [braking_ahead(road.cars[name]) for name in "BC"] == [["warning"]] * 2
    assert len(road.warns()) <= 31


def test_a_braking_vehicle_that_falls_silent_is_warned_of_for_the_event_lifetime() -> None:
    # A crash may destroy the radio.
    road = row("ABC")
    road.brake("A")
    road.run(0.1)
    road.cars["A"].has_radio = False
    road.run(road.parameters.event_lifetime_s - 0.2)
    assert braking_ahead(road.cars["C"]) == ["warning"]
    road.run(0.3)
    assert braking_ahead(road.cars["C"]) == ["warning", "warning_over"]
    assert a(WarningOver, road.cars["C"].said[-1]).reason == "expired"


def test_a_braking_raised_under_two_ids_of_one_vehicle_ends_under_both() -> None:
    """Its vehicle has changed its ID before this one identifies it as the lead."""
    old, new = car_id("X"), car_id("X", 1)
    car = OneCar()
    car.sees(A, 0.0)
    car.hears(answer(car.asks(0.0), leader=old, number=2), 0.0)
    for named in (old, new):
        warn = Warn(named, old, 1, named, 5, 0, 1, 5, WarnCause.DECELERATION, 6.0, 0.0, 1)
        car.group.receive_message(warn, 0.1)
    car.group.receive_lead(MeasuredLead(new, 20.0, 0.0, previous_id=old), 0.2)
    car.group.handle_timer(5.0)
    events = list(iter(car.group.next_event, None))
    raised = [each.origin_id for each in events if isinstance(each, WarningRaised)]
    assert raised == [old, new]
    assert {each.origin_id for each in events if isinstance(each, WarningOver)} == {old, new}


def test_a_warning_that_arrives_after_the_end_is_outdated() -> None:
    road = row("AB")
    delayed: list[Transmission] = []

    def first_copy(entry: Transmission, to: str) -> bool:
        if isinstance(entry.message, Warn) and not delayed:
            delayed.append(entry)
            return True
        return False

    road.drops = first_copy
    road.brake("A")
    road.run(0.01)
    road.release("A")
    road.run(0.5)
    b = road.cars["B"]
    road.do(b, lambda now: b.group.receive_message(delayed[0].message, now))
    assert b.warnings == []
    assert b.discarded[-1] == "outdated"


def test_a_forged_sequence_number_far_ahead_does_not_suppress_a_braking() -> None:
    road = row("ABC")
    road.brake("A")
    road.run(0.1)
    forged = replace(road.warns()[0].warn, event_sequence=40_000, cause=WarnCause.OVER)
    for name in "BC":
        car = road.cars[name]
        road.do(car, partial(car.group.receive_message, forged))
    assert braking_ahead(road.cars["C"]) == ["warning"]  # An end comes from B only.
    road.run(1.1)
    assert braking_ahead(road.cars["C"]) == ["warning", "warning_over", "warning"]


def test_the_button_warns_of_a_test_that_ends_by_itself() -> None:
    road = row("ABC")
    road.brake("A", 4.0, BrakeCause.TEST)
    road.run(2.0)
    assert braking_ahead(road.cars["C"]) == ["warning", "warning_over"]
    assert road.cars["C"].warnings[0].cause is BrakeCause.TEST


def test_a_button_that_is_pressed_again_and_again_sends_no_more_warnings() -> None:
    """A program may press it for the driver, as often as it likes."""
    road = row("AB")
    for _ in range(30):
        road.brake("A", 4.0, BrakeCause.TEST)
        road.run(0.02)
    assert len(road.warns()) == 1
    road.run(2.0)
    assert braking_ahead(road.cars["B"]) == ["warning", "warning_over"]


def test_a_real_braking_takes_the_place_of_a_test_and_not_the_other_way_round() -> None:
    road = row("ABC")
    road.brake("A", 4.0, BrakeCause.TEST)
    road.run(0.5)
    road.brake("A", 7.0)
    road.run(0.5)
    road.brake("A", 4.0, BrakeCause.TEST)
    road.run(2.0)
    c = road.cars["C"]
    assert braking_ahead(c) == ["warning", "warning_level"]
    assert a(WarningLevel, c.said[-1]).cause is BrakeCause.DECELERATION
