"""Which members are warned."""

import numpy as np

from onboard.lcca.events import WarningRaised
from onboard.messages.lcca import Reply, Update
from onboard.observations import BrakeCause
from tests.lcca.road import Air, Road, car_id, places
from tests.lcca.rows import fewest_transmissions, row, warned

A = car_id("A")


def test_the_demonstration_of_the_paper() -> None:
    # Three cars in a lane, one in another; the first brakes.
    road = Road()
    road.add_row("ABC")
    d = road.add("D", -10.0, lane=1)
    road.run(2.0)
    road.brake("A", 7.0)
    road.run(1.0)
    assert warned(road) == "BC"
    assert d.discarded == ["not_in_group"]
    assert road.cars["C"].warnings == [
        WarningRaised(
            stamp_s=2.002,
            origin_id=A,
            sequence=road.warns()[0].warn.event_sequence,
            origin_number=1,
            group_number=3,
            leader_id=A,
            cause=BrakeCause.DECELERATION,
            deceleration_m_s2=7.0,
            age_s=0.0,
            hops=1,
        )
    ]


def test_vehicles_ahead_discard_the_warning() -> None:
    road = row("ABCD")
    road.brake("C")
    road.run(1.0)
    assert warned(road) == "D"
    assert "from_behind" in road.cars["A"].discarded
    assert "from_behind" in road.cars["B"].discarded


def test_another_group_discards_the_warning() -> None:
    road = Road()
    road.add_row("ABC", lane=0)
    road.add_row("XYZ", lane=1)
    road.run(2.0)
    road.brake("A")
    road.run(1.0)
    assert warned(road) == "BC"
    assert [road.cars[name].discarded[-1] for name in "XYZ"] == ["other_group"] * 3


def test_a_regular_vehicle_sends_no_warning() -> None:
    road = row("AB", gap_m=60.0)
    road.brake("A")
    road.run(1.0)
    assert road.warns() == []


def test_the_last_members_warning_is_sent_and_not_repeated() -> None:
    # LCCA: "whenever i is in the LEADER/MEMBER state and performs an emergency brake".
    road = row("ABC")
    road.brake("C")
    road.run(1.0)
    assert len(road.warns()) == 1
    assert warned(road) == ""


def test_each_braking_is_one_alarm_and_two_at_once_are_two() -> None:
    road = row("ABCD", Air(reach_m=45.0))
    road.brake("A")
    road.run(0.003)
    road.brake("B")
    road.run(1.0)
    origins = {car.name: [w.origin_number for w in car.warnings] for car in road.cars.values()}
    assert origins == {"A": [], "B": [1], "C": [1, 2], "D": [2, 1]} or origins["D"] == [1, 2]
    assert len(road.warns()) == fewest_transmissions(road, "A", "D") + 1


def test_a_member_with_an_outdated_leader_accepts_its_predecessor() -> None:
    # The group joins Z, and no update and no reply arrives: C still takes A for its leader.
    road = row("ABC")
    road.add("Z", 80.0)
    road.run(1.0)
    road.drops = lambda entry, to: to == "C" and isinstance(entry.message, Update | Reply)
    for name in "ABC":
        road.cars[name].position_m += 50.0
    road.run(0.6)
    assert places(road)["B"] == ("Z", 3)
    assert places(road)["C"] == ("A", 3)
    road.brake("Z")
    road.run(1.0)
    assert warned(road) == "ABC"
    assert "other_group" in road.cars["C"].discarded


def test_a_warning_during_a_change_of_ids_arrives() -> None:
    """Under both names, where only others say that these are one vehicle."""
    for after_s in np.arange(0.0, 0.6, 0.05):
        road = row("ABCDEF", Air(reach_m=45.0))
        road.change_ids(spread_s=0.5)
        road.run(float(after_s))
        road.brake("A")
        road.run(2.0)
        names = [[each.origin_id for each in car.warnings] for car in road.cars.values()]
        assert [len(each) for each in names[:2]] == [0, 1]
        both = {car_id("A"), car_id("A", 1)}
        assert all(each and set(each) <= both and len(each) == len(set(each)) for each in names[2:])
