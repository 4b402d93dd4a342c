"""Crash probability from gap, speeds and reaction time."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from onboard.access import crash_probability
from onboard.access.crash_probability import normal_cdf, rear_end_crash_probability
from onboard.access.rear_end import tolerable_lag_s

LOG_REACTION = (math.log(0.95), 0.35)
DECELERATION_M_S2 = (4.0, 8.0)


def test_it_equals_the_share_of_crashes_with_random_reactions_and_decelerations() -> None:
    rng = np.random.default_rng(1)
    n = 200_000
    for gap_m in (8.0, 20.0, 45.0):
        reaction_s = np.exp(rng.normal(*LOG_REACTION, n))
        lead_a, a = rng.uniform(*DECELERATION_M_S2, (2, n))
        collided = reaction_s > tolerable_lag_s(np.array(gap_m), 20.0, 20.0, lead_a, a)

        found = rear_end_crash_probability(
            np.array(gap_m), 20.0, 20.0, LOG_REACTION, DECELERATION_M_S2
        )

        assert found == pytest.approx(collided.mean(), abs=0.006)


def test_a_finer_integration_changes_it_by_less_than_0_003(monkeypatch: pytest.MonkeyPatch) -> None:
    gap_m = np.linspace(2.0, 80.0, 40)
    coarse = rear_end_crash_probability(gap_m, 20.0, 20.0, LOG_REACTION, DECELERATION_M_S2)
    monkeypatch.setattr(crash_probability, "POINTS", 32)

    fine = rear_end_crash_probability(gap_m, 20.0, 20.0, LOG_REACTION, DECELERATION_M_S2)

    assert np.max(np.abs(fine - coarse)) < 0.003


@given(
    st.floats(0.0, 200.0), st.floats(0.1, 60.0), st.floats(0.0, 60.0),
    st.floats(-2.0, 2.0), st.floats(0.05, 1.0),
)  # fmt: skip
def test_it_falls_with_gap_and_lead_speed_and_rises_with_the_reaction_time(
    gap_m: float, speed_m_s: float, lead_m_s: float, mean: float, sigma: float
) -> None:
    here = rear_end_crash_probability(
        np.array(gap_m), lead_m_s, speed_m_s, (mean, sigma), DECELERATION_M_S2
    )

    def other(**changed: float) -> float:
        given = {"gap": gap_m, "lead": lead_m_s, "mean": mean} | changed
        return float(
            rear_end_crash_probability(
                np.array(given["gap"]),
                given["lead"],
                speed_m_s,
                (given["mean"], sigma),
                DECELERATION_M_S2,
            )
        )

    assert 0.0 <= here <= 1.0
    assert other(gap=gap_m + 5.0) <= here + 1e-9
    assert other(lead=lead_m_s + 3.0) <= here + 1e-9
    assert other(mean=mean + 0.3) >= here - 1e-9


def test_arrays_give_the_values_of_their_elements() -> None:
    gap_m = np.array([[5.0, 15.0], [25.0, 60.0]])

    together = rear_end_crash_probability(gap_m, 18.0, 20.0, LOG_REACTION, DECELERATION_M_S2)

    assert together.shape == (2, 2)
    assert together[1, 0] == rear_end_crash_probability(
        gap_m[1, 0], 18.0, 20.0, LOG_REACTION, DECELERATION_M_S2
    )


@given(st.floats(-40.0, 40.0))
def test_the_normal_distribution_function_matches_scipy(z: float) -> None:
    assert float(normal_cdf(np.array(z))) == pytest.approx(norm.cdf(z), abs=1e-7)
