"""Conversion of remote time stamps to the host's clock."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.sensors.remote_clock import RemoteClock

UTC_S = 1.7e9


def stamps(
    arrivals: list[float], latency_s: float = 0.1, start_utc_s: float = UTC_S
) -> list[float]:
    clock = RemoteClock(latency_s)
    return [clock.receive_stamp(start_utc_s + n, now) for n, now in enumerate(arrivals)]


def test_without_jitter_a_stamp_is_the_arrival_minus_the_latency() -> None:
    assert stamps([50.1, 51.1, 52.1]) == pytest.approx([50.0, 51.0, 52.0])


def test_jitter_does_not_enter_the_stamp() -> None:
    """Late by up to 0.5 s, as on a slow serial line or a busy computer."""
    late = np.random.default_rng(1).uniform(0.0, 0.5, 300)
    late[::5] = 0.0
    stamps_s = stamps([50.1 + n + lateness for n, lateness in enumerate(late)])
    errors = np.array(stamps_s[10:]) - (50.0 + np.arange(10, 300))
    assert np.abs(errors).max() < 1e-6


def test_a_drifting_clock_is_followed() -> None:
    """100 ppm, the drift of a poor quartz: 6 ms a minute."""
    stamps_s = stamps([50.1 + n * (1 + 1e-4) for n in range(600)])
    errors = np.array(stamps_s) - (50.0 + np.arange(600) * (1 + 1e-4))
    assert np.abs(errors).max() < 0.0065


def test_a_step_of_the_remote_clock_is_followed_at_once() -> None:
    """The receiver gets its leap seconds, then the right week."""
    clock = RemoteClock(0.1)
    assert clock.receive_stamp(UTC_S, 50.1) == pytest.approx(50.0)
    assert clock.receive_stamp(UTC_S + 1 - 18, 51.1) == pytest.approx(51.0)
    assert clock.receive_stamp(UTC_S + 2 - 18 + 1024 * 7 * 86400, 52.1) == pytest.approx(52.0)


@pytest.mark.parametrize("back_s", [0.6, 1.0, 1.9])
def test_a_remote_clock_that_is_set_back_a_little_is_followed_after_five_seconds(
    back_s: float,
) -> None:
    """A receiver with firmware of before 2017 lacks one leap second until satellites tell it."""
    clock = RemoteClock(0.1)
    for n in range(300):
        now = 50.1 + n / 10
        stamp_s = clock.receive_stamp(UTC_S + n / 10 - (back_s if n >= 100 else 0.0), now)
        if not 100 <= n <= 150:
            assert stamp_s == pytest.approx(now - 0.1, abs=1e-5)


def test_a_jam_of_some_seconds_is_lateness() -> None:
    clock = RemoteClock(0.1)
    for n in range(300):
        late_s = 0.9 if 100 <= n <= 140 else 0.0
        stamp_s = clock.receive_stamp(UTC_S + n / 10, 50.1 + n / 10 + late_s)
        assert stamp_s == pytest.approx(50.0 + n / 10, abs=1e-5)


@pytest.mark.parametrize("ahead_s", [0.1, 0.5, 1.9, 2.5, 60.0])
def test_one_stamp_that_is_dated_ahead_does_not_make_the_next_ones_late(ahead_s: float) -> None:
    """A faulty datagram, or one of another program on the machine."""
    clock = RemoteClock(0.1)
    for n in range(600):
        now = 50.1 + n / 10
        is_ahead = n in (20, 50, 55)
        stamp_s = clock.receive_stamp(UTC_S + n / 10 + (ahead_s if is_ahead else 0.0), now)
        assert stamp_s == pytest.approx(now - 0.1, abs=1e-5)
        ahead_s += 0.06 * is_ahead


def test_a_smaller_lateness_counts_from_the_second_stamp_on() -> None:
    clock = RemoteClock(0.1)
    assert clock.receive_stamp(UTC_S, 50.6) == pytest.approx(50.5)
    assert clock.receive_stamp(UTC_S + 1, 51.1) == pytest.approx(51.0)
    assert clock.receive_stamp(UTC_S + 2, 52.1) == pytest.approx(52.0)
    assert clock.receive_stamp(UTC_S + 3, 53.4) == pytest.approx(53.0)


def test_without_utc_the_arrival_counts() -> None:
    assert RemoteClock(0.1).receive_stamp(None, 50.1) == pytest.approx(50.0)


@given(
    steps=st.lists(
        st.tuples(st.floats(0, 100), st.floats(0, 4e9), st.booleans()), min_size=1, max_size=40
    )
)
def test_a_stamp_is_never_later_than_its_arrival(steps: list[tuple[float, float, bool]]) -> None:
    clock = RemoteClock(0.1)
    now = 0.0
    for step_s, utc_s, is_known in steps:
        now += step_s
        assert clock.receive_stamp(utc_s if is_known else None, now) <= now - 0.1 + 1e-5
