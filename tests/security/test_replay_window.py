"""The replay window: duplicate messages are refused, in bounded memory."""

from hypothesis import given
from hypothesis import strategies as st

from onboard.security.replay_window import ReplayWindow

SECOND = 1_000_000


def test_a_digest_is_kept_for_the_window_and_older_messages_are_refused() -> None:
    window = ReplayWindow(5 * SECOND, capacity=100)
    window.add(b"a", made_us=10 * SECOND, now_us=10 * SECOND)
    window.add(b"b", made_us=14 * SECOND, now_us=15 * SECOND)
    assert b"a" in window
    window.add(b"c", made_us=16 * SECOND, now_us=16 * SECOND)
    assert b"a" not in window
    assert window.forgotten_us == 10 * SECOND, "what is as old is not believed any more"


def test_a_flood_takes_bounded_memory_without_a_gap() -> None:
    window = ReplayWindow(5 * SECOND, capacity=100)
    for i in range(1000):
        window.add(i.to_bytes(2), made_us=i, now_us=i)
    assert len(window) == 100
    assert all(i.to_bytes(2) in window for i in range(900, 1000))
    assert window.forgotten_us == 899


@given(
    st.lists(
        st.tuples(st.integers(0, 30 * SECOND), st.integers(-2 * SECOND, 5 * SECOND)), max_size=80
    )
)
def test_every_added_digest_is_kept_or_too_old_even_if_the_clock_steps_back(
    steps: list[tuple[int, int]],
) -> None:
    window = ReplayWindow(5 * SECOND, capacity=20)
    had = []
    for i, (now_us, age_us) in enumerate(steps):
        made_us = max(1, now_us - age_us)
        window.add(i.to_bytes(2), made_us, now_us)
        had.append((i.to_bytes(2), made_us))
    assert len(window) <= 20
    assert all(digest in window or made <= window.forgotten_us for digest, made in had)


def test_a_clock_set_back_by_minutes_does_not_block_reception() -> None:
    window = ReplayWindow(5 * SECOND, capacity=1)
    for made_us in (600 * SECOND, 601 * SECOND):
        window.add(made_us.to_bytes(8), made_us, made_us)
    window.receive_time(599 * SECOND)
    assert window.forgotten_us == 600 * SECOND, "a few seconds are waited for"

    window.receive_time(10 * SECOND)

    assert window.forgotten_us == 0
