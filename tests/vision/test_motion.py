"""The filter of gap and closing speed, against least squares and its own sigmas."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.vision.motion import FrameMotion


def filtered(
    positions_m: list[float], sigma_m: float, step_s: float, acceleration_sigma_m_s2: float
) -> FrameMotion:
    motion = FrameMotion(
        positions_m[0],
        sigma_m,
        0.0,
        rate_sigma_m_s=1e4,
        acceleration_sigma_m_s2=acceleration_sigma_m_s2,
    )
    for index, position_m in enumerate(positions_m[1:], start=1):
        motion.predict(index * step_s)
        motion.update(position_m, sigma_m)
    return motion


@given(st.lists(st.floats(0.0, 80.0), min_size=3, max_size=30), st.floats(0.02, 0.5))
def test_without_acceleration_it_is_a_straight_line_fit(
    positions_m: list[float], step_s: float
) -> None:
    stamps_s = np.arange(len(positions_m)) * step_s
    slope, start = np.polyfit(stamps_s, positions_m, 1)

    motion = filtered(positions_m, 1.0, step_s, acceleration_sigma_m_s2=1e-9)

    assert motion.rate_m_s == pytest.approx(slope, abs=1e-3 / step_s)
    assert motion.position_m == pytest.approx(start + slope * stamps_s[-1], abs=1e-3)


def test_the_filters_sigmas_are_right_for_its_noise() -> None:
    rng = np.random.default_rng(3)
    step_s, sigma_m, acceleration = 0.1, 0.4, 2.0
    errors = []
    for _ in range(200):
        speeds = np.cumsum(rng.normal(0.0, acceleration * step_s**0.5, 60)) - 2.0
        gaps = 30.0 + np.cumsum(speeds) * step_s
        motion = filtered(list(gaps + rng.normal(0.0, sigma_m, 60)), sigma_m, step_s, acceleration)
        errors.append(
            (
                (motion.position_m - gaps[-1]) / motion.position_sigma_m,
                (motion.rate_m_s - speeds[-1]) / motion.rate_sigma_m_s,
            )
        )
    assert np.std(errors, axis=0) == pytest.approx([1.0, 1.0], abs=0.15)
    assert np.mean(errors, axis=0) == pytest.approx([0.0, 0.0], abs=0.2)


def test_a_time_that_has_passed_changes_nothing() -> None:
    motion = filtered([10.0, 11.0, 12.0], 0.1, 0.1, 1.0)
    before = (motion.position_m, motion.rate_m_s, motion.position_sigma_m)

    motion.predict(0.1)

    assert (motion.position_m, motion.rate_m_s, motion.position_sigma_m) == before


def test_without_measurements_the_sigma_grows() -> None:
    motion = filtered([30.0 - 0.2 * index for index in range(30)], 0.1, 0.1, 1.0)
    sigma_m = motion.position_sigma_m

    motion.predict(2.9 + 1.0)

    assert motion.position_m == pytest.approx(30.0 - 0.2 * 29 - 2.0, abs=0.1)
    assert motion.position_sigma_m > 3 * sigma_m
