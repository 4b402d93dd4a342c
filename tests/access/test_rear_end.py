"""Table I's four kinds of collision, against small time steps."""

import numpy as np
import pytest

from onboard.access.rear_end import Braking, collision_kind, tolerable_lag_s

V = 20.0


def stepped_kind(gap: float, lead: Braking, follower: Braking) -> int:
    dt = 1e-3
    time_s = np.arange(0.0, 30.0, dt)

    def speed(car: Braking) -> np.ndarray:
        return np.clip(V - car.deceleration_m_s2 * np.maximum(time_s - car.begins_at_s, 0), 0, V)

    lead_speed, follower_speed = speed(lead), speed(follower)
    gap_m = gap + np.cumsum(lead_speed - follower_speed) * dt
    hits = np.flatnonzero(gap_m <= 0.0)
    if not len(hits):
        return 0
    at = hits[0]
    return 1 + int(lead_speed[at] == 0.0) + 2 * int(time_s[at] > follower.begins_at_s)


@pytest.mark.parametrize(
    ("gap_m", "lead_a", "reacts_at_s", "kind"),
    [
        (5.0, 8.0, 3.0, 1),
        (28.0, 8.0, 4.0, 2),
        (8.0, 8.0, 1.3, 3),
        (30.0, 8.0, 1.3, 4),
        (60.0, 8.0, 1.0, 0),
    ],
)
def test_the_four_kinds(gap_m: float, lead_a: float, reacts_at_s: float, kind: int) -> None:
    lead = Braking(np.array(lead_a), np.array(0.0))
    follower = Braking(np.array(5.0), np.array(reacts_at_s))

    assert collision_kind(np.array(gap_m), np.array(V), lead, follower) == kind


def test_agrees_with_small_steps_everywhere() -> None:
    rng = np.random.default_rng(1)
    n = 300
    gap = rng.uniform(0.5, 60.0, n)
    lead = Braking(rng.uniform(4.0, 8.0, n), rng.uniform(0.0, 2.0, n))
    follower = Braking(rng.uniform(4.0, 8.0, n), rng.uniform(0.0, 4.0, n))

    kinds = collision_kind(gap, np.array(V), lead, follower)

    stepped = [
        stepped_kind(gap[i], *(Braking(car[0][i], car[1][i]) for car in (lead, follower)))
        for i in range(n)
    ]
    differing = np.flatnonzero(kinds != stepped)
    assert len(differing) <= 2, "grazing contacts fall on either side of a time step"
    assert set(kinds.tolist()) == {0, 1, 2, 3, 4}


def test_touching_cars_have_collided() -> None:
    brake = Braking(np.array(5.0), np.array(1.0))

    assert collision_kind(np.array(0.0), np.array(V), brake, brake) != 0


def test_equal_braking_at_once_never_collides() -> None:
    brake = Braking(np.array(6.0), np.array(1.0))

    assert collision_kind(np.array(0.01), np.array(V), brake, brake) == 0


@pytest.mark.parametrize(
    ("gap_m", "a", "told"), [(-1.0, 5.0, "negative"), (5.0, 0.0, "decelerations are positive")]
)
def test_nonsense_is_refused(gap_m: float, a: float, told: str) -> None:
    brake = Braking(np.array(a), np.array(0.0))

    with pytest.raises(ValueError, match=told):
        collision_kind(np.array(gap_m), np.array(V), brake, brake)


def test_at_one_speed_a_follower_collides_exactly_if_it_lags_more_than_tolerable() -> None:
    rng = np.random.default_rng(2)
    n = 50_000
    gap_m = rng.uniform(0.1, 80.0, n)
    lead = Braking(rng.uniform(2.0, 9.0, n), rng.uniform(0.0, 5.0, n))
    follower = Braking(rng.uniform(2.0, 9.0, n), rng.uniform(0.0, 5.0, n))

    lag_s = tolerable_lag_s(gap_m, V, V, lead.deceleration_m_s2, follower.deceleration_m_s2)

    collides = collision_kind(gap_m, np.array(V), lead, follower) > 0
    assert np.array_equal(collides, follower.begins_at_s - lead.begins_at_s > lag_s)


def test_at_two_speeds_it_agrees_with_small_steps() -> None:
    rng = np.random.default_rng(3)
    n = 2000
    gap_m, lag_s = rng.uniform(1.0, 80.0, n), rng.uniform(0.0, 4.0, n)
    lead_v, v = rng.uniform(0.0, 30.0, (2, n))
    lead_a, a = rng.uniform(2.0, 9.0, (2, n))
    nearest_m, lead_speed, speed, now_m, dt = gap_m.copy(), lead_v, v, gap_m, 2e-3
    for step in range(20_000):
        lead_next = np.maximum(lead_speed - lead_a * dt, 0.0)
        next_ = np.maximum(speed - a * dt * (step * dt >= lag_s), 0.0)
        now_m = now_m + 0.5 * dt * (lead_speed + lead_next - speed - next_)
        nearest_m, lead_speed, speed = np.minimum(nearest_m, now_m), lead_next, next_
        if not speed.any():
            break

    tolerable_s = tolerable_lag_s(gap_m, lead_v, v, lead_a, a)

    clear = np.abs(nearest_m) > 0.1
    assert clear.mean() > 0.98
    assert np.array_equal((nearest_m <= 0.0)[clear], (lag_s > tolerable_s)[clear])


def test_equal_brakes_tolerate_the_headway() -> None:
    lag_s = tolerable_lag_s(np.array(30.0), V, V, np.array(6.0), np.array(6.0))

    assert lag_s == pytest.approx(30.0 / V)


def test_who_brakes_weakly_must_begin_first() -> None:
    assert tolerable_lag_s(np.array(5.0), V, V, np.array(8.0), np.array(4.0)) < 0.0
