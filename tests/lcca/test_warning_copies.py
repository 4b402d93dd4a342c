"""How many messages a warning takes, and how soon it arrives."""

from itertools import accumulate

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.lcca.events import WarningOver
from onboard.messages.lcca import Join, Update
from tests.lcca.road import Air, Road, places, true_places
from tests.lcca.rows import fewest_transmissions, row


@pytest.mark.long
@settings(max_examples=25, derandomize=True)
@given(
    gaps_m=st.lists(st.floats(6.0, 38.0), min_size=2, max_size=14),
    reach_m=st.floats(39.0, 200.0),
    origin=st.integers(0, 5),
    seed=st.integers(0, 99),
)
def test_on_a_perfect_channel_the_number_of_copies_is_minimal(
    gaps_m: list[float], reach_m: float, origin: int, seed: int
) -> None:
    road = Road(Air(reach_m=reach_m), seed=seed)
    names = "ABCDEFGHIJKLMNOP"[: len(gaps_m) + 1]
    for name, behind_m in zip(names, accumulate(gaps_m, initial=0.0), strict=True):
        road.add(name, -behind_m)
    road.run(4.0)
    assert places(road) == true_places(road)
    first = names[min(origin, len(names) - 2)]
    braked_at = road.now
    road.brake(first)
    road.run(0.9)
    assert len(road.warns()) == fewest_transmissions(road, first, names[-1])
    for car in road.cars.values():
        behind = names.index(car.name) > names.index(first)
        assert len(car.warnings) == int(behind)
        for warning in car.warnings:
            hops = fewest_transmissions(road, first, car.name)
            assert warning.hops == hops
            # Repeated at once: only the air takes time.
            assert warning.stamp_s - braked_at == pytest.approx(hops * road.air.delay_s)
            assert warning.age_s == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("reach_m", [45.0, 110.0, 300.0])
def test_the_end_of_a_braking_that_is_proved_takes_as_few_copies_as_its_begin(
    reach_m: float,
) -> None:
    names = "ABCDEFGHIJKLMNOPQRSTUVWX"
    road = row(names, Air(reach_m=reach_m), proves_ids=True)
    road.brake("A")
    road.run(0.9)
    begun = len(road.warns())
    road.release("A")
    road.run(0.9)

    assert begun == fewest_transmissions(road, "A", names[-1])
    assert len(road.warns()) == 2 * begun
    for car in list(road.cars.values())[1:]:
        assert [each.reason for each in car.said if isinstance(each, WarningOver)] == ["over"]


def test_the_end_of_a_braking_that_is_not_proved_is_repeated_by_each_vehicle() -> None:
    road = row("ABCDEFGH")
    road.brake("A")
    road.run(0.9)
    before = len(road.warns())
    road.release("A")
    road.run(0.9)

    assert len(road.warns()) - before == len("ABCDEFG")


@pytest.mark.parametrize("names", ["ABCDEF", "ABCDEFG", "ABCDEFGH"])
@pytest.mark.parametrize("reach_m", [45.0, 300.0])
def test_each_vehicle_that_is_followed_updates_once(names: str, reach_m: float) -> None:
    road = row(names, Air(reach_m=reach_m))
    road.add("Z", 80.0)
    road.run(2.0)
    before = len(road.sent)
    for name in names:
        road.cars[name].position_m += 50.0  # the whole group closes up to Z
    road.run(1.0)
    assert places(road) == true_places(road)
    updates = [e.sender for e in road.sent[before:] if isinstance(e.message, Update)]
    assert updates == list(names[:-1])


def test_a_warning_costs_no_message_beyond_its_copies() -> None:
    # Acknowledgements of begin and end are joins sent before they are due.
    def joins(brakes: bool) -> int:
        road = row("ABCDEF", Air(reach_m=45.0))
        before = len(road.sent)
        if brakes:
            road.brake("A")
        road.run(0.3)
        if brakes:
            road.release("A")
        road.run(20.0)
        return sum(isinstance(entry.message, Join) for entry in road.sent[before:])

    assert abs(joins(brakes=True) - joins(brakes=False)) <= 3 * 5
