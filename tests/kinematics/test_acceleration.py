"""The slope of a speed over a short window, against what it was made from."""

import numpy as np
import pytest

from onboard.kinematics.acceleration import AccelerationEstimator
from onboard.kinematics.units import KM_H


def trend_of(samples: list[tuple[float, float]], window_s: float = 0.5) -> AccelerationEstimator:
    trend = AccelerationEstimator(window_s)
    for stamp_s, speed_m_s in samples:
        trend.receive_speed(stamp_s, speed_m_s)
    return trend


def test_the_slope_is_the_least_squares_line_of_the_window() -> None:
    rng = np.random.default_rng(1)
    samples = [(k / 20, 20.0 - 3.0 * k / 20 + 0.2 * rng.normal()) for k in range(40)]

    within = np.array([each for each in samples if each[0] >= samples[-1][0] - 0.5 - 1e-9])
    expected = np.polyfit(within[:, 0], within[:, 1], 1)[0]

    assert trend_of(samples, 0.5 + 1e-9).acceleration_m_s2 == pytest.approx(expected, rel=1e-9)


def test_whole_km_h_at_20_hz_give_half_a_metre_per_second_squared() -> None:
    exact = [(k / 20, 20.0 - 4.0 * k / 20) for k in range(60)]
    coarse = [(at, round(speed / KM_H) * KM_H) for at, speed in exact]

    slopes = [trend_of(coarse[: n + 1]).acceleration_m_s2 for n in range(15, 60)]

    assert all(slope is not None and abs(slope + 4.0) < 0.6 for slope in slopes)


@pytest.mark.parametrize(
    "samples",
    [
        [],
        [(0.0, 10.0)],
        [(0.0, 10.0), (0.1, 11.0), (0.2, 12.0)],
        [(0.0, 10.0), (0.01, 10.0), (0.02, 10.0), (0.03, 10.0)],
    ],
    ids=["none", "one", "too few", "too short"],
)
def test_nothing_is_estimated_from_too_few_samples(samples: list[tuple[float, float]]) -> None:
    assert trend_of(samples).acceleration_m_s2 is None


def test_old_samples_leave_and_late_ones_are_ignored() -> None:
    trend = trend_of([(k / 10, 30.0) for k in range(10)] + [(1.0 + k / 10, 20.0) for k in range(8)])
    trend.receive_speed(1.65, 99.0)

    assert trend.acceleration_m_s2 == pytest.approx(0.0, abs=1e-9)


def test_one_stamp_far_ahead_costs_the_window_and_no_more() -> None:
    trend = trend_of([(k / 10, 10.0) for k in range(10)] + [(1e6, 10.0)])

    for k in range(10, 20):
        trend.receive_speed(k / 10, 10.0 - 3.0 * k / 10)

    assert trend.acceleration_m_s2 == pytest.approx(-3.0)


def test_another_car_begins_anew() -> None:
    trend = trend_of([(k / 10, 10.0) for k in range(10)])
    trend.clear()

    assert trend.acceleration_m_s2 is None
