"""What a detector of the user's sends, and what becomes of it."""

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.detector.object_list import MOST_CARS, ObjectListReader
from onboard.observations import DetectionList, Discarded, VehicleDetection

CAR = {
    "id": 7, "range_m": 31.5, "range_sigma_m": 1.5, "bearing_rad": -0.12, "bearing_sigma_rad": 0.01
}  # fmt: skip


def datagram(*cars: dict[str, Any], sent_s: float = 10.0, age_s: float = 0.04) -> bytes:
    return json.dumps({"sent_s": sent_s, "age_s": age_s, "cars": cars}).encode()


def read(*data: bytes, now: float = 500.0) -> list[DetectionList | Discarded]:
    reader = ObjectListReader()
    for each in data:
        reader.receive_bytes(each, now)
    return list(iter(reader.next_event, None))


def reason_of(data: bytes) -> str:
    (event,) = read(data)
    assert isinstance(event, Discarded)
    assert event.component == "detector"
    return event.reason


def test_a_picture_with_cars() -> None:
    (found,) = read(datagram(CAR, CAR | {"id": 8}))

    first = VehicleDetection(pytest.approx(499.96), 7, 31.5, 1.5, -0.12, 0.01)
    assert isinstance(found, DetectionList)
    assert found.cars[0] == first
    assert [car.track_id for car in found.cars] == [7, 8]
    assert {car.stamp_s for car in found.cars} == {found.stamp_s}


def test_to_find_no_car_is_an_answer_too() -> None:
    (found,) = read(datagram())

    assert found == DetectionList(pytest.approx(499.96), ())


def test_whole_numbers_and_keys_of_the_detector_s_own_are_welcome() -> None:
    (found,) = read(datagram(CAR | {"range_m": 30, "class": "truck"}, sent_s=9))

    assert isinstance(found, DetectionList)
    assert found.cars[0].range_m == 30.0


def test_what_is_held_up_on_its_way_keeps_the_time_of_its_picture() -> None:
    """The detector's clock began somewhere else; nothing is quicker than the quickest."""
    reader = ObjectListReader()
    for k, late_s in enumerate((0.0, 0.2, 0.1, 0.0, 0.3)):
        reader.receive_bytes(datagram(CAR, sent_s=7000.0 + 0.1 * k), 500.0 + 0.1 * k + late_s)

    stamps_s = [event.stamp_s for event in iter(reader.next_event, None)]
    assert stamps_s == pytest.approx([499.96 + 0.1 * k for k in range(5)])


def test_two_that_come_together_are_two_pictures_and_a_flood_is_none() -> None:
    pictures = read(*[datagram(sent_s=10.0 + 0.1 * k) for k in range(3)])
    flood = read(*[datagram(sent_s=10.0 + 0.001 * k) for k in range(10)])

    assert [event.kind for event in pictures] == ["detection_list"] * 3
    assert [event.kind for event in flood] == ["detection_list", *["discarded"] * 9]
    assert flood[1].reason == "too_often"  # type: ignore[union-attr]


@pytest.mark.parametrize(
    "change",
    [
        {"range_m": 0.0},
        {"range_m": -3.0},
        {"range_m": 1e9},
        {"range_m": "31"},
        {"range_m": None},
        {"range_m": math.nan},
        {"range_sigma_m": 0.0},
        {"range_sigma_m": math.inf},
        {"bearing_rad": 3.2},
        {"bearing_sigma_rad": 0.0},
        {"id": -1},
        {"id": 1.5},
        {"id": 1 << 31},
    ],
)
def test_a_car_that_cannot_be_costs_the_whole_picture(change: dict[str, Any]) -> None:
    assert reason_of(datagram(CAR, CAR | {"id": 8} | change)) == "no_object_list"


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"garbage",
        b"\xff\xfe",
        b"[]",
        b"{}",
        b'{"sent_s": 1.0, "age_s": 0.1}',
        datagram(age_s=-0.1),
        datagram(age_s=1.1),
        datagram(sent_s=math.inf),
        datagram(sent_s=1.79e12),
        datagram(sent_s=-1.79e18),
        datagram(*[CAR | {"id": k} for k in range(MOST_CARS + 1)]),
        b"[" * 60_000,
    ],
)
def test_what_is_no_object_list_is_counted(data: bytes) -> None:
    assert reason_of(data) == "no_object_list"


def test_the_first_mistake_is_named() -> None:
    (event,) = read(datagram(CAR | {"range_m": -3.0}))

    assert isinstance(event, Discarded)
    assert event.detail.startswith("cars.0.range_m: ")


def test_one_id_is_one_car() -> None:
    assert reason_of(datagram(CAR, CAR | {"range_m": 50.0})) == "repeated_id"


@given(st.lists(st.binary(max_size=200), max_size=5))
def test_whatever_comes_every_datagram_has_one_answer(data: list[bytes]) -> None:
    assert len(read(*data)) == len(data)
