"""The collision probability that makes a car safe or unsafe."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from onboard.access import crash_probability
from onboard.access.crash_probability import normal_share_below, rear_end_crash_probability
from onboard.access.rear_end import tolerable_lag_s

ORDINARY = (math.log(0.95), 0.35)
BRAKES = (4.0, 8.0)


def test_it_is_how_often_drawn_reactions_and_decelerations_collide() -> None:
    rng = np.random.default_rng(1)
    n = 200_000
    for gap_m in (8.0, 20.0, 45.0):
        reaction_s = np.exp(rng.normal(*ORDINARY, n))
        lead_a, a = rng.uniform(*BRAKES, (2, n))
        collided = reaction_s > tolerable_lag_s(np.array(gap_m), 20.0, 20.0, lead_a, a)

        found = rear_end_crash_probability(np.array(gap_m), 20.0, 20.0, ORDINARY, BRAKES)

        assert found == pytest.approx(collided.mean(), abs=0.006)


def test_more_points_hardly_change_it(monkeypatch: pytest.MonkeyPatch) -> None:
    gap_m = np.linspace(2.0, 80.0, 40)
    coarse = rear_end_crash_probability(gap_m, 20.0, 20.0, ORDINARY, BRAKES)
    monkeypatch.setattr(crash_probability, "POINTS", 32)

    fine = rear_end_crash_probability(gap_m, 20.0, 20.0, ORDINARY, BRAKES)

    assert np.max(np.abs(fine - coarse)) < 0.003


@given(
    st.floats(0.0, 200.0), st.floats(0.1, 60.0), st.floats(0.0, 60.0),
    st.floats(-2.0, 2.0), st.floats(0.05, 1.0),
)  # fmt: skip
def test_it_falls_with_the_gap_and_rises_with_closing_and_reaction(
    gap_m: float, speed_m_s: float, lead_m_s: float, mean: float, sigma: float
) -> None:
    here = rear_end_crash_probability(np.array(gap_m), lead_m_s, speed_m_s, (mean, sigma), BRAKES)

    def other(**changed: float) -> float:
        given = {"gap": gap_m, "lead": lead_m_s, "mean": mean} | changed
        return float(
            rear_end_crash_probability(
                np.array(given["gap"]), given["lead"], speed_m_s, (given["mean"], sigma), BRAKES
            )
        )

    assert 0.0 <= here <= 1.0
    assert other(gap=gap_m + 5.0) <= here + 1e-9
    assert other(lead=lead_m_s + 3.0) <= here + 1e-9
    assert other(mean=mean + 0.3) >= here - 1e-9


def test_many_at_once_are_what_each_is_alone() -> None:
    gap_m = np.array([[5.0, 15.0], [25.0, 60.0]])

    together = rear_end_crash_probability(gap_m, 18.0, 20.0, ORDINARY, BRAKES)

    assert together.shape == (2, 2)
    assert together[1, 0] == rear_end_crash_probability(gap_m[1, 0], 18.0, 20.0, ORDINARY, BRAKES)


@given(st.floats(-40.0, 40.0))
def test_a_normal_variable_is_below_a_point_as_often_as_it_should(z: float) -> None:
    assert float(normal_share_below(np.array(z))) == pytest.approx(norm.cdf(z), abs=1e-7)
