"""Evidence of a vehicle's position, compared with what scipy computes."""

import math

import pytest
from scipy import stats

from onboard.lcca.position_match import (
    LEAST,
    MOST,
    REFERENCE_M,
    ROW_M,
    position_log_ratio,
    row_log_ratio,
)


@pytest.mark.parametrize(
    ("ahead_m", "right_m", "sigma_m"), [(24.5, 0.0, 2.0), (30.0, 4.0, 2.0), (18.0, -3.0, 8.0)]
)
def test_it_is_the_ratio_of_a_normal_and_a_uniform_density(
    ahead_m: float, right_m: float, sigma_m: float
) -> None:
    here = stats.norm(24.5, math.hypot(sigma_m, 5.0, 3.0)).pdf(ahead_m) * stats.norm(
        0.0, math.hypot(sigma_m, 5.0, 3.0)
    ).pdf(right_m)
    expected = math.log(here * 1000.0 * 30.0)
    assert position_log_ratio(ahead_m, right_m, sigma_m, 20.0) == pytest.approx(
        min(max(expected, LEAST), MOST)
    )


def test_a_vehicle_behind_or_on_another_road_is_excluded() -> None:
    assert position_log_ratio(-30.0, 0.0, 2.0, 20.0) == LEAST
    assert position_log_ratio(24.5, 80.0, 2.0, 20.0) == LEAST


def test_lanes_are_not_distinguished() -> None:
    same = position_log_ratio(24.5, 0.0, 2.0, 20.0)
    assert same - position_log_ratio(24.5, 3.5, 2.0, 20.0) < 0.3


def test_a_vehicle_of_the_row_is_in_the_lane_near_and_at_no_place_of_its_own() -> None:
    in_lane = row_log_ratio(120.0, 0.0, 2.0)
    assert in_lane == row_log_ratio(-120.0, 0.0, 2.0) > 0.5
    assert row_log_ratio(120.0, 25.0, 2.0) < in_lane - 5.0
    assert row_log_ratio(2.0 * ROW_M, 0.0, 2.0) == LEAST


def test_the_place_of_the_lead_says_more_for_the_lead_than_for_another_one_of_its_row() -> None:
    at_lead = 20.0 + REFERENCE_M
    assert position_log_ratio(at_lead, 0.0, 2.0, 20.0) > row_log_ratio(at_lead, 0.0, 2.0)
    assert position_log_ratio(at_lead + 40.0, 0.0, 2.0, 20.0) < row_log_ratio(
        at_lead + 40.0, 0.0, 2.0
    )
