"""Tolerable lag in closed form, against a simulation in small time steps."""

import numpy as np
import pytest

from onboard.access.rear_end import Array, tolerable_lag_s

V = 20.0


def smallest_gap_m(
    gap_m: Array, speeds: tuple[Array, Array], brakes: tuple[Array, Array], lag_s: Array
) -> Array:
    """Return the smallest gap until the follower stops; with a negative lag it brakes first."""
    dt = 2e-3
    (lead_v, v), (lead_a, a) = speeds, brakes
    lead_at_s, at_s = np.maximum(-lag_s, 0.0), np.maximum(lag_s, 0.0)
    smallest, gap, lead_speed, speed = gap_m, gap_m, lead_v, v
    for step in range(30_000):
        lead_next = np.maximum(lead_speed - lead_a * dt * (step * dt >= lead_at_s), 0.0)
        next_ = np.maximum(speed - a * dt * (step * dt >= at_s), 0.0)
        gap = gap + 0.5 * dt * (lead_speed + lead_next - speed - next_)
        smallest, lead_speed, speed = np.minimum(smallest, gap), lead_next, next_
        if not speed.any():
            break
    return smallest


@pytest.mark.parametrize("is_one_speed", [False, True])
def test_the_follower_crashes_exactly_if_it_brakes_later(is_one_speed: bool) -> None:
    rng = np.random.default_rng(3)
    n = 2000
    gap_m = rng.uniform(1.0, 80.0, n)
    lead_v, v = np.full((2, n), V) if is_one_speed else rng.uniform(0.0, 30.0, (2, n))
    lead_a, a = rng.uniform(2.0, 9.0, (2, n))
    lag_s = rng.uniform(-4.0 if is_one_speed else 0.0, 4.0, n)

    tolerable_s = tolerable_lag_s(gap_m, lead_v, v, lead_a, a)

    smallest = smallest_gap_m(gap_m, (lead_v, v), (lead_a, a), lag_s)
    clear = np.abs(smallest) > 0.1
    assert clear.mean() > 0.98
    assert np.array_equal((smallest <= 0.0)[clear], (lag_s > tolerable_s)[clear])


def test_with_equal_decelerations_the_tolerable_lag_is_the_headway() -> None:
    lag_s = tolerable_lag_s(np.array(30.0), V, V, np.array(6.0), np.array(6.0))

    assert lag_s == pytest.approx(30.0 / V)


def test_a_weakly_braking_follower_has_to_brake_first() -> None:
    assert tolerable_lag_s(np.array(5.0), V, V, np.array(8.0), np.array(4.0)) < 0.0
