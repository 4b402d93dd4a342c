"""Speeds at breakpoints become exact positions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from sim_rig.roads.piecewise_linear import PiecewiseLinear

COURSE = [(2.0, 10.0), (4.0, 20.0), (5.0, 20.0), (9.0, 0.0)]


@pytest.mark.parametrize(
    ("at_s", "value", "slope"),
    [
        (0.0, 10.0, 0.0),
        (2.0, 10.0, 5.0),
        (3.0, 15.0, 5.0),
        (4.0, 20.0, 0.0),
        (6.0, 15.0, -5.0),
        (9.0, 0.0, 0.0),
        (99.0, 0.0, 0.0),
    ],
)
def test_linear_between_breakpoints_and_constant_outside(
    at_s: float, value: float, slope: float
) -> None:
    course = PiecewiseLinear(COURSE)

    assert course.value(at_s) == pytest.approx(value)
    assert course.sample(at_s)[1] == pytest.approx(slope)


@given(at_s=st.floats(min_value=-5.0, max_value=20.0))
def test_the_integral_is_that_of_the_value(at_s: float) -> None:
    course = PiecewiseLinear(COURSE)
    expected, _ = quad(course.value, 2.0, at_s, points=[4.0, 5.0, 9.0], limit=200)

    assert course.sample(at_s)[2] == pytest.approx(expected, abs=1e-6)


def test_the_slope_is_the_derivative_of_the_value() -> None:
    course = PiecewiseLinear(COURSE)
    for at_s in np.arange(0.05, 12.0, 0.1):
        around = course.value(at_s + 1e-4) - course.value(at_s - 1e-4)
        assert course.sample(at_s)[1] == pytest.approx(around / 2e-4, abs=1e-6)
