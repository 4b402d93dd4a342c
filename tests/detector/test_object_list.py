"""Object lists of a detector: decoded, or discarded as a whole."""

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.detector.object_list import MOST_VEHICLES, ObjectListReader
from onboard.observations import DetectionList, Discarded, VehicleDetection
from tests.typed import a, about

VEHICLE = {
    "id": 7, "range_m": 31.5, "range_sigma_m": 1.5, "bearing_rad": -0.12, "bearing_sigma_rad": 0.01
}  # fmt: skip


def datagram(*vehicles: dict[str, Any], sent_s: float = 10.0, age_s: float = 0.04) -> bytes:
    return json.dumps({"sent_s": sent_s, "age_s": age_s, "cars": vehicles}).encode()


def read(*data: bytes, now: float = 500.0, every_s: float = 0.0) -> list[DetectionList | Discarded]:
    reader = ObjectListReader()
    for at, each in enumerate(data):
        reader.receive_bytes(each, now + at * every_s)
    return list(iter(reader.next_event, None))


def reason_of(data: bytes) -> str:
    (event,) = read(data)
    assert isinstance(event, Discarded)
    assert event.component == "detector"
    return event.reason


def test_an_image_with_two_vehicles() -> None:
    (detections,) = read(datagram(VEHICLE, VEHICLE | {"id": 8}))

    first = VehicleDetection(about(499.96), 7, 31.5, 1.5, -0.12, 0.01)
    assert isinstance(detections, DetectionList)
    assert detections.cars[0] == first
    assert [each.track_id for each in detections.cars] == [7, 8]
    assert {each.stamp_s for each in detections.cars} == {detections.stamp_s}


def test_an_image_without_vehicles_gives_an_empty_list() -> None:
    (detections,) = read(datagram())

    assert detections == DetectionList(about(499.96), ())


def test_integers_and_unknown_keys_are_accepted() -> None:
    (detections,) = read(datagram(VEHICLE | {"range_m": 30, "class": "truck"}, sent_s=9))

    assert isinstance(detections, DetectionList)
    assert detections.cars[0].range_m == 30.0


def test_a_late_datagram_keeps_the_time_of_its_image() -> None:
    """The detector's clock has another origin; the least late datagram gives the offset."""
    reader = ObjectListReader()
    for k, late_s in enumerate((0.0, 0.2, 0.1, 0.0, 0.3)):
        reader.receive_bytes(datagram(VEHICLE, sent_s=7000.0 + 0.1 * k), 500.0 + 0.1 * k + late_s)

    stamps_s = [a(DetectionList, event).stamp_s for event in iter(reader.next_event, None)]
    assert stamps_s == pytest.approx([499.96 + 0.1 * k for k in range(5)])


def test_datagrams_may_arrive_together_but_not_be_sent_too_fast() -> None:
    images = read(*[datagram(sent_s=10.0 + 0.1 * k) for k in range(3)])
    flood = read(*[datagram(sent_s=10.0 + 0.001 * k) for k in range(10)])

    assert [event.kind for event in images] == ["detection_list"] * 3
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
def test_an_impossible_vehicle_discards_the_whole_datagram(change: dict[str, Any]) -> None:
    assert reason_of(datagram(VEHICLE, VEHICLE | {"id": 8} | change)) == "no_object_list"


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
        datagram(*[VEHICLE | {"id": k} for k in range(MOST_VEHICLES + 1)]),
        b"[" * 60_000,
    ],
)
def test_other_data_is_discarded_with_a_reason(data: bytes) -> None:
    assert reason_of(data) == "no_object_list"


def test_the_detail_names_the_first_invalid_field() -> None:
    (event,) = read(datagram(VEHICLE | {"range_m": -3.0}))

    assert isinstance(event, Discarded)
    assert event.detail.startswith("cars.0.range_m: ")


def test_two_vehicles_with_one_id_are_discarded() -> None:
    assert reason_of(datagram(VEHICLE, VEHICLE | {"range_m": 50.0})) == "repeated_id"


@given(st.lists(st.binary(max_size=200), max_size=5))
def test_any_datagram_gives_one_event(data: list[bytes]) -> None:
    assert len(read(*data)) == len(data)


RATE = {"range_rate_m_s": -2.5, "range_rate_sigma_m_s": 0.1}


def test_a_range_rate_comes_with_its_sigma() -> None:
    (detections,) = read(datagram(VEHICLE | RATE, VEHICLE | {"id": 8}))

    assert isinstance(detections, DetectionList)
    assert [each.range_rate_m_s for each in detections.cars] == [-2.5, None]
    assert [each.range_rate_sigma_m_s for each in detections.cars] == [0.1, None]


@pytest.mark.parametrize(
    "rate",
    [
        {"range_rate_m_s": -2.5},
        {"range_rate_sigma_m_s": 0.1},
        RATE | {"range_rate_m_s": 200.0},
        RATE | {"range_rate_m_s": "fast"},
        RATE | {"range_rate_sigma_m_s": 0.0},
    ],
)
def test_an_incomplete_or_impossible_range_rate_discards_the_datagram(rate: dict[str, Any]) -> None:
    assert reason_of(datagram(VEHICLE | rate)) == "no_object_list"


def sweeps(rate_m_s: float, range_rate_m_s: float, count: int = 30) -> list[bytes]:
    """Ten a second, of a vehicle that approaches with `rate_m_s`."""
    return [
        datagram(
            VEHICLE
            | {"range_m": 60.0 + rate_m_s * k / 10, "range_sigma_m": 0.3}
            | RATE
            | {"range_rate_m_s": range_rate_m_s},
            sent_s=10.0 + k / 10,
        )
        for k in range(count)
    ]


def test_range_rates_that_contradict_the_ranges_are_discarded_and_the_ranges_used() -> None:
    events = read(*sweeps(-5.0, 3.0), every_s=0.1)

    lists = [event for event in events if isinstance(event, DetectionList)]
    discarded = [event for event in events if isinstance(event, Discarded)]
    assert len(lists) == 30
    assert {event.reason for event in discarded} == {"range_rate"}
    assert [each.cars[0].range_rate_m_s for each in lists[12:]] == [None] * 18


def test_range_rates_that_agree_are_used() -> None:
    events = read(*sweeps(-5.0, -5.0), every_s=0.1)

    assert all(isinstance(event, DetectionList) for event in events)


def test_a_detector_that_agrees_again_is_trusted_after_a_span() -> None:
    wrong, right = sweeps(-5.0, 3.0, 12), sweeps(-5.0, -5.0, 40)[12:]

    last = read(*wrong, *right, every_s=0.1)[-1]

    assert isinstance(last, DetectionList)
    assert last.cars[0].range_rate_m_s == -5.0
