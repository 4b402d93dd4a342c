"""Table I's kinds of collisions and pile-ups, compared with small time steps."""

import numpy as np
import pytest

from onboard.access.rear_end import tolerable_lag_s
from sim_rig.studies.rakhshan.collisions import (
    NO_COLLISION,
    CarBraking,
    collision_kind,
    hits_in_pile_up,
    speed_after,
    travelled_m,
)

SPEED_M_S = 20.0
STEP_S = 1e-3
TIME_S = np.arange(0.0, 30.0, STEP_S)


def stepped_kind(gap_m: float, lead: CarBraking, follower: CarBraking) -> int:
    """Kind from the speeds at each step."""
    lead_m_s, follower_m_s = (
        np.clip(
            SPEED_M_S - car.deceleration_m_s2 * np.maximum(TIME_S - car.begins_at_s, 0.0), 0.0, None
        )
        for car in (lead, follower)
    )
    hits = np.flatnonzero(gap_m + np.cumsum(lead_m_s - follower_m_s) * STEP_S <= 0.0)
    if not len(hits):
        return NO_COLLISION
    return 1 + int(lead_m_s[hits[0]] == 0.0) + 2 * int(TIME_S[hits[0]] > follower.begins_at_s)


@pytest.mark.parametrize(
    ("gap_m", "reacts_at_s", "kind"),
    [(5.0, 3.0, 1), (28.0, 4.0, 2), (8.0, 1.3, 3), (30.0, 1.3, 4), (60.0, 1.0, NO_COLLISION)],
)
def test_the_four_kinds(gap_m: float, reacts_at_s: float, kind: int) -> None:
    lead = CarBraking(np.array(8.0), np.array(0.0))
    follower = CarBraking(np.array(5.0), np.array(reacts_at_s))

    assert collision_kind(np.array(gap_m), SPEED_M_S, lead, follower) == kind


def test_kinds_agree_with_small_steps() -> None:
    rng = np.random.default_rng(1)
    gap_m = rng.uniform(0.5, 60.0, 300)
    lead, follower = (
        CarBraking(rng.uniform(4.0, 8.0, 300), rng.uniform(0.0, latest_s, 300))
        for latest_s in (2.0, 4.0)
    )

    kinds = collision_kind(gap_m, SPEED_M_S, lead, follower)

    stepped = [
        stepped_kind(gap_m[i], *(CarBraking(car[0][i], car[1][i]) for car in (lead, follower)))
        for i in range(len(gap_m))
    ]
    assert np.sum(kinds != stepped) <= 2, "a step decides grazing contacts"
    assert set(kinds.tolist()) == {NO_COLLISION, 1, 2, 3, 4}


def test_a_follower_collides_exactly_if_it_lags_more_than_tolerable() -> None:
    rng = np.random.default_rng(2)
    gap_m = rng.uniform(0.1, 80.0, 50_000)
    lead, follower = (
        CarBraking(rng.uniform(2.0, 9.0, len(gap_m)), rng.uniform(0.0, 5.0, len(gap_m)))
        for _ in "ab"
    )

    lag_s = tolerable_lag_s(
        gap_m, SPEED_M_S, SPEED_M_S, lead.deceleration_m_s2, follower.deceleration_m_s2
    )

    collides = collision_kind(gap_m, SPEED_M_S, lead, follower) != NO_COLLISION
    assert np.array_equal(collides, follower.begins_at_s - lead.begins_at_s > lag_s)


def test_distance_is_the_integral_of_speed() -> None:
    car = CarBraking(np.array(6.0), np.array(1.2))

    speeds_m_s = speed_after(TIME_S + STEP_S / 2, SPEED_M_S, car)

    assert speeds_m_s.sum() * STEP_S == pytest.approx(travelled_m(30.0, SPEED_M_S, car), abs=1e-4)


@pytest.mark.parametrize(
    ("gap_m", "deceleration_m_s2", "message"),
    [(-1.0, 5.0, "must not be negative"), (5.0, 0.0, "decelerations must be positive")],
)
def test_invalid_arguments_are_an_error(
    gap_m: float, deceleration_m_s2: float, message: str
) -> None:
    braking = CarBraking(np.array(deceleration_m_s2), np.array(0.0))

    with pytest.raises(ValueError, match=message):
        collision_kind(np.array(gap_m), SPEED_M_S, braking, braking)


def test_a_car_that_hits_the_lead_leaves_less_room_for_the_next() -> None:
    """Alone, car 1 stops in 60 m and car 2 in 70 m behind it; car 0 stands after 25 m."""
    braking = CarBraking(np.array([8.0, 5.0, 5.0]), np.array([0.0, 1.0, 1.5]))
    gap_m = np.array([0.0, 10.0, 15.0])
    is_late = np.array([True, False])

    assert hits_in_pile_up(gap_m, SPEED_M_S, braking, is_late).tolist() == [True, True]
    assert hits_in_pile_up(gap_m + 30.0, SPEED_M_S, braking, ~is_late).tolist() == [False, True]
    assert not hits_in_pile_up(gap_m + 30.0, SPEED_M_S, braking, is_late & False).any()
