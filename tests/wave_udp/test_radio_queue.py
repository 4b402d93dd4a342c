"""The transmit queue: by priority, without expired frames, bounded; in virtual time."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.observations import Discarded
from onboard.wave_udp.radio_queue import RadioQueue
from tests.typed import a

BSM, WARN = 5, 7
LATER = 1e9


def sent(queue: RadioQueue, until: float, now: float = 0.0) -> list[tuple[float, int, bytes]]:
    """Drive the queue as the daemon does, up to `until`; return (time, priority, wsm)."""
    out = []
    while True:
        out += [(now, *frame) for frame in queue.wsms_to_send(now)]
        at = queue.get_timer()
        if at > until:
            return out
        now = at


def drops(queue: RadioQueue) -> list[str]:
    return [event.reason for event in iter(queue.next_event, None)]


def test_an_idle_radio_gets_the_frame_at_once() -> None:
    queue = RadioQueue()
    queue.put(b"bsm", BSM, LATER, now=10.0)
    assert queue.wsms_to_send(10.0) == [(BSM, b"bsm")]
    assert queue.get_timer() == math.inf


def test_a_warning_overtakes_everything_queued() -> None:
    queue = RadioQueue()
    for n in range(5):
        queue.put(b"bsm%d" % n, BSM, LATER, now=0.0)
    queue.put(b"warn", WARN, LATER, now=0.0)
    assert [frame for _, _, frame in sent(queue, until=1.0)] == [
        b"warn", b"bsm0", b"bsm1", b"bsm2", b"bsm3", b"bsm4",
    ]  # fmt: skip


def test_what_is_less_urgent_than_asked_for_stays_in_the_queue() -> None:
    queue = RadioQueue()
    queue.put(b"bsm", BSM, LATER, now=0.0)
    assert queue.wsms_to_send(0.0, least_priority=WARN) == []
    queue.put(b"warn", WARN, LATER, now=0.0)
    assert queue.wsms_to_send(0.0, least_priority=WARN) == [(WARN, b"warn")]
    assert [frame for _, _, frame in sent(queue, until=1.0, now=queue.get_timer())] == [b"bsm"]


def test_a_warning_waits_for_at_most_the_frame_on_the_air() -> None:
    queue = RadioQueue(data_rate_mbit_s=6.0)
    for _ in range(10):
        queue.put(bytes(300), BSM, LATER, now=0.0)
    assert len(queue.wsms_to_send(0.0)) == 1
    queue.put(b"warn", WARN, LATER, now=0.0001)
    free_at = queue.get_timer()
    # (300 + 32) bytes at 6 Mbit/s, and 150 us of overhead
    assert free_at == pytest.approx(332 * 8 / 6e6 + 150e-6)
    assert queue.wsms_to_send(free_at - 1e-6) == []
    assert queue.wsms_to_send(free_at) == [(WARN, b"warn")]


def test_expired_frames_are_dropped_before_a_warning_waits() -> None:
    queue = RadioQueue()
    queue.put(b"first", BSM, expires_at=1.0, now=0.0)
    queue.put(b"old", BSM, expires_at=0.0001, now=0.0)
    queue.put(b"new", BSM, expires_at=1.0, now=0.0)
    assert [frame for _, _, frame in sent(queue, until=1.0)] == [b"first", b"new"]
    assert drops(queue) == ["expired"]


def test_a_frame_that_expires_now_is_not_sent() -> None:
    queue = RadioQueue()
    queue.put(b"bsm", BSM, expires_at=2.0, now=1.0)
    assert queue.wsms_to_send(2.0) == []
    event = a(Discarded, queue.next_event())
    assert (event.stamp_s, event.component, event.reason) == (2.0, "radio", "expired")


def test_a_full_queue_drops_the_oldest_frame_of_lowest_priority() -> None:
    queue = RadioQueue(capacity=3)
    queue.put(b"a", 3, LATER, now=0.0)
    queue.put(b"b", 1, LATER, now=0.0)
    queue.put(b"c", 1, LATER, now=0.0)
    queue.put(b"d", WARN, LATER, now=0.0)
    assert [frame for _, _, frame in sent(queue, until=1.0)] == [b"d", b"a", b"c"]
    assert drops(queue) == ["queue_full"]


def test_a_queue_full_of_warnings_drops_a_new_bsm() -> None:
    queue = RadioQueue(capacity=2)
    for frame, priority in ((b"w1", WARN), (b"w2", WARN), (b"bsm", BSM)):
        queue.put(frame, priority, LATER, now=0.0)
    assert [frame for _, _, frame in sent(queue, until=1.0)] == [b"w1", b"w2"]
    assert drops(queue) == ["queue_full"]


@pytest.mark.parametrize("priority", [-1, 8])
def test_a_priority_out_of_range_is_a_value_error(priority: int) -> None:
    with pytest.raises(ValueError, match="a user priority is 0 to 7"):
        RadioQueue().put(b"", priority, LATER, now=0.0)


frames = st.lists(
    st.tuples(
        st.integers(0, 7),
        st.floats(0.0, 0.02),  # lifetime
        st.floats(0.0, 0.005),  # until the next is put
        st.integers(0, 1400),
    ),
    max_size=60,
)


@given(frames, st.integers(1, 20))
def test_every_frame_is_sent_once_in_time_or_its_drop_is_reported(
    puts: list[tuple[int, float, float, int]], capacity: int
) -> None:
    queue = RadioQueue(capacity=capacity)
    out, now, expiry = [], 0.0, {}
    for number, (priority, lifetime, pause, size) in enumerate(puts):
        wsm = number.to_bytes(4) + bytes(size)
        expiry[wsm] = now + lifetime
        queue.put(wsm, priority, now + lifetime, now)
        assert len(queue) <= capacity
        out += sent(queue, until=now + pause, now=now)
        now += pause
    out += sent(queue, until=now + 10.0, now=now)
    assert len({wsm for _, _, wsm in out}) == len(out)
    assert all(at < expiry[wsm] for at, _, wsm in out)
    assert len(out) + len(drops(queue)) == len(puts)
    assert len(queue) == 0


@given(st.lists(st.integers(0, 7), max_size=60))
def test_frames_are_sent_by_priority_and_in_order_within_one(priorities: list[int]) -> None:
    queue = RadioQueue(capacity=60)
    for number, priority in enumerate(priorities):
        queue.put(bytes((number,)), priority, LATER, now=0.0)
    expected = sorted(enumerate(priorities), key=lambda item: -item[1])
    assert [frame[0] for _, _, frame in sent(queue, until=1.0)] == [n for n, _ in expected]
