"""The drive of the load test: what the sensors show is one motion."""

import math

import numpy as np
import pytest

from sim_rig.studies.soak.braking_lead import (
    GAP_M,
    HOST_M_S,
    LARGEST_GAP_M,
    LEAST_GAP_M,
    PERIOD_S,
    BrakingLead,
)

BEGINS_S = 5.0
TIMES_S = np.arange(0.0, BEGINS_S + 20 * PERIOD_S, 0.01)


@pytest.fixture
def drive() -> BrakingLead:
    lead = BrakingLead(0.0)
    lead.brakes_from_at = BEGINS_S
    return lead


def test_gap_and_place_follow_from_the_speed(drive: BrakingLead) -> None:
    speeds_m_s = np.array([drive.lead_m_s(at + 0.005) for at in TIMES_S[:-1]])
    for places_m in (drive.lead_m, lambda at: drive.gap_m(at) + HOST_M_S * at):
        driven_m = np.diff([places_m(at) for at in TIMES_S])
        assert np.allclose(driven_m, speeds_m_s * 0.01, atol=5e-4)


def test_it_cruises_and_then_brakes_hard_in_each_period_without_drifting_away(
    drive: BrakingLead,
) -> None:
    gaps_m = [drive.gap_m(at) for at in TIMES_S]
    braking_m_s2 = -np.diff([drive.lead_m_s(at) for at in TIMES_S]) / 0.01
    assert {round(gap_m, 9) for gap_m in gaps_m[: round(BEGINS_S * 100)]} == {GAP_M}
    assert braking_m_s2.max() == pytest.approx(8.0)
    assert min(gaps_m) >= LEAST_GAP_M - 1e-9
    assert max(gaps_m) <= LARGEST_GAP_M + 1e-9
    assert drive.gap_m(BEGINS_S + 1000 * PERIOD_S) == pytest.approx(GAP_M, abs=1e-6)
    assert math.isclose(drive.lead_m_s(0.0), HOST_M_S)
