"""The channel between stations: carrier sense, collisions, hidden stations, capture."""

import heapq
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_rig.propagation.path_loss import LIGHT_M_S
from sim_rig.radio.channel import Channel, Reception
from sim_rig.scenario.radio_settings import CsmaSettings

AIRTIME_S = 432e-6
"""Of 250 bytes at 6 Mbit/s."""
WARNING, BEACON = 7, 5


def channel(*along_m: float, seed: int = 1, **keys: object) -> Channel:
    it = Channel(CsmaSettings.model_validate(keys), len(along_m), np.random.default_rng(seed))
    it.receive_positions(np.array([(along, 0.0) for along in along_m]))
    return it


def receptions(it: Channel) -> list[Reception]:
    found = []
    while (at := it.get_timer()) < math.inf:
        it.handle_timer(at)
    while (event := it.next_event()) is not None:
        found.append(event)
    return found


def test_a_frame_arrives_after_airtime_and_propagation_delay() -> None:
    it = channel(0.0, 300.0)
    number = it.receive_frame(0, 250, BEACON, 1.0)

    (reception,) = receptions(it)
    assert (reception.number, reception.sender) == (number, 0)
    assert reception.receivers.tolist() == [1]
    assert 1.0 <= reception.sent_s <= 1.0 + 13e-6
    way_s = 300.0 / LIGHT_M_S
    assert reception.at_s[0] == pytest.approx(reception.sent_s + AIRTIME_S + way_s, abs=1e-9)


def test_the_edge_of_reach_is_where_the_preamble_sinks_into_the_noise() -> None:
    # 20 dBm - 87.86 dB - 38 lg(d / 100 m) = -97 dBm + 4 dB gives 459 m.
    it = channel(0.0, 455.0, 463.0)
    for moment in range(50):
        it.receive_frame(0, 250, BEACON, 0.1 * moment)

    heard = [reception.receivers.tolist() for reception in receptions(it)]
    assert heard.count([1]) > 40
    assert not any(2 in receivers for receivers in heard)


def test_a_station_in_range_defers_and_both_frames_are_received() -> None:
    it = channel(0.0, 50.0, 100.0)
    it.receive_frame(0, 250, BEACON, 1.0)
    it.receive_frame(2, 250, BEACON, 1.0 + 100e-6)

    first, second = receptions(it)
    assert second.sent_s > first.sent_s + AIRTIME_S
    assert first.receivers.tolist() == [1, 2]
    assert second.receivers.tolist() == [0, 1]


def test_a_frame_that_waits_for_half_a_second_is_given_up() -> None:
    it = channel(0.0, 50.0)
    for _ in range(1200):  # each takes some 0.5 ms
        it.receive_frame(0, 250, BEACON, 1.0)

    found = receptions(it)
    assert len(found) == 1200
    sent = [each for each in found if each.receivers.tolist() == [1]]
    given_up = [each for each in found if math.isnan(each.sent_s)]
    assert len(sent) + len(given_up) == 1200
    assert max(each.sent_s for each in sent) == pytest.approx(1.5, abs=0.001)
    assert {each.number for each in given_up} == set(range(len(sent), 1200))


def test_what_follows_a_frame_that_is_given_up_goes_at_once() -> None:
    it = channel(0.0, 50.0)
    for _ in range(1200):
        it.receive_frame(0, 250, BEACON, 1.0)
    young = it.receive_frame(0, 250, BEACON, 1.4)

    last = [each for each in receptions(it) if each.number == young]
    assert last[0].sent_s == pytest.approx(1.5, abs=0.001)


def test_hidden_stations_do_not_wait_and_spoil_each_other_between_them() -> None:
    it = channel(0.0, 440.0, 880.0)
    it.receive_frame(0, 250, BEACON, 1.0)
    it.receive_frame(2, 250, BEACON, 1.0 + 100e-6)

    first, second = receptions(it)
    assert second.sent_s < first.sent_s + AIRTIME_S
    assert first.receivers.tolist() == []
    assert second.receivers.tolist() == []


def test_of_hidden_stations_the_near_one_is_received() -> None:
    it = channel(0.0, 100.0, 600.0)
    it.receive_frame(0, 250, BEACON, 1.0)
    it.receive_frame(2, 250, BEACON, 1.0 + 100e-6)

    assert [reception.receivers.tolist() for reception in receptions(it)] == [[1], []]


def simultaneous(*along_m: float) -> list[Reception]:
    """The first and the last of them transmit in one slot."""
    it = channel(*along_m)
    it.receive_frame(0, 250, BEACON, 1.0)
    it.receive_frame(len(along_m) - 1, 250, BEACON, 1.0)
    return receptions(it)


def test_stations_that_transmit_in_the_same_slot_miss_each_other() -> None:
    both = simultaneous(0.0, 60.0)

    assert both[0].sent_s == both[1].sent_s
    assert [reception.receivers.tolist() for reception in both] == [[], []]


def test_of_two_in_one_slot_the_much_stronger_is_captured() -> None:
    near, far = simultaneous(0.0, 20.0, 200.0)

    assert near.receivers.tolist() == [1]
    assert far.receivers.tolist() == []


def test_of_two_equally_strong_in_one_slot_neither_is() -> None:
    assert [it.receivers.tolist() for it in simultaneous(0.0, 100.0, 200.0)] == [[], []]


def test_a_later_frame_is_not_captured_however_strong() -> None:
    """The receiver stays with what it listens to (no capture beyond the preamble)."""
    it = channel(0.0, 400.0, 860.0)
    it.receive_frame(0, 250, BEACON, 1.0)
    it.receive_frame(2, 250, BEACON, 1.0 + 100e-6)
    assert [reception.receivers.tolist() for reception in receptions(it)] == [[], []]

    it = channel(860.0, 400.0, 390.0)
    it.receive_frame(0, 250, BEACON, 1.0)  # out of reach of both
    it.receive_frame(2, 250, BEACON, 1.0 + 100e-6)
    assert [reception.receivers.tolist() for reception in receptions(it)] == [[], [1]]


def test_an_absent_station_neither_receives_nor_interferes() -> None:
    it = channel(0.0, 50.0, math.nan)
    it.receive_frame(2, 250, BEACON, 1.0)
    it.receive_frame(0, 250, BEACON, 1.0)

    heard = {reception.sender: reception.receivers.tolist() for reception in receptions(it)}
    assert heard == {0: [1], 2: []}


def test_stations_move() -> None:
    it = channel(0.0, 1000.0)
    it.receive_frame(0, 250, BEACON, 1.0)
    it.handle_timer(1.5)
    it.receive_positions(np.array([[0.0, 0.0], [100.0, 0.0]]))
    it.receive_frame(0, 250, BEACON, 2.0)

    assert [reception.receivers.tolist() for reception in receptions(it)] == [[], [1]]


def busy_road(seed: int, cars: int = 40, interval_s: float = 0.012, **keys: object) -> Channel:
    """A channel that is nearly full; every tenth frame is a warning."""
    it = channel(*(5.0 * car for car in range(cars)), seed=seed, **keys)
    rng = np.random.default_rng(seed)
    queue = [(at, car) for car, at in enumerate(rng.uniform(0.0, interval_s, cars).tolist())]
    heapq.heapify(queue)
    while queue[0][0] < 0.3:
        at, car = heapq.heappop(queue)
        it.receive_frame(car, 250, WARNING if rng.random() < 0.1 else BEACON - 4, at)
        heapq.heappush(queue, (at + interval_s + rng.uniform(0.0, 0.001), car))
    return it


def test_warnings_overtake_beacons_on_a_full_channel() -> None:
    it = channel(*(5.0 * car for car in range(20)))
    numbers = {}
    for car in range(20):
        numbers[it.receive_frame(car, 250, 1, 1.0)] = "beacon"
        numbers[it.receive_frame(car, 250, WARNING, 1.0)] = "warning"

    went = [numbers[reception.number] for reception in receptions(it)]
    assert went.count("warning") == went.count("beacon") == 20
    assert set(went[:20]) == {"warning"}


def test_every_frame_ends_once_and_no_station_receives_two_at_once() -> None:
    it = busy_road(4, nakagami_m=1.0)
    found = receptions(it)

    numbers = [reception.number for reception in found]
    assert sorted(numbers) == list(range(len(numbers)))
    assert len(numbers) > 500
    listening: dict[int, list[tuple[float, float]]] = {}
    for reception in found:
        end_s = reception.sent_s + AIRTIME_S
        listening.setdefault(reception.sender, []).append((reception.sent_s, end_s))
        for receiver, at_s in zip(reception.receivers.tolist(), reception.at_s, strict=True):
            assert receiver != reception.sender
            listening.setdefault(receiver, []).append((at_s - AIRTIME_S, at_s))
    for spans in listening.values():
        pairs = pairwise(sorted(spans))
        assert all(later[0] >= sooner[1] - 1e-9 for sooner, later in pairs)


@pytest.mark.long
def test_the_same_seed_gives_the_same_to_the_bit_and_another_does_not() -> None:
    def delivered(seed: int) -> list[tuple[int, float, bytes]]:
        found = receptions(busy_road(seed, nakagami_m=2.0))
        return [(it.number, it.sent_s, it.at_s.tobytes()) for it in found]

    assert delivered(3) == delivered(3)
    assert delivered(3) != delivered(4)


def test_handled_in_large_steps_everything_happens_as_in_small_ones() -> None:
    def delivered(step_s: float) -> list[tuple[int, float]]:
        it = channel(*(20.0 * car for car in range(30)), seed=7)
        found, now = [], 0.0
        for number in range(200):
            it.receive_frame(number % 30, 250, BEACON, 0.0007 * number)
            while now < 0.0007 * number:
                now += step_s
                it.handle_timer(min(now, 0.0007 * number))
        while (event := it.next_event()) is not None:
            found.append((event.number, event.sent_s))
        return found

    assert delivered(1.0) == delivered(1e-4)


@settings(max_examples=20)
@given(st.lists(st.floats(0.0, 0.01), min_size=2, max_size=12), st.integers(0, 7))
def test_within_reach_frames_without_overlap_are_received_by_all(
    offsets_s: list[float], user_priority: int
) -> None:
    it = channel(*(30.0 * index for index in range(len(offsets_s))))
    for index, offset_s in enumerate(offsets_s):
        it.receive_frame(index, 100, user_priority, 0.1 * index + offset_s)

    found = receptions(it)
    assert all(len(reception.receivers) == len(offsets_s) - 1 for reception in found)
