"""Constant acceleration between standstill and top speed, and its two inverses."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from onboard.risk.trajectory import acceleration_to_cover, reached_after_s, travelled_m

speeds = st.floats(0.0, 40.0)
accelerations = st.floats(-10.0, 5.0)
times = st.floats(0.01, 60.0)


def stepped_m(time_s: float, a: float, v: float, top: float) -> float:
    dt = 1e-4
    speed = np.clip(v + a * np.arange(0.0, time_s, dt), 0.0, top)
    return float(np.sum(speed) * dt)


@pytest.mark.parametrize(
    ("time_s", "a", "v"), [(3.0, -4.0, 8.0), (5.0, 2.0, 10.0), (4.0, 0.0, 9.0), (2.0, -9.5, 0.0)]
)
def test_travelled_is_the_integral_of_the_limited_speed(time_s: float, a: float, v: float) -> None:
    got = travelled_m(np.array(time_s), np.array(a), np.array(v), np.array(15.0))

    assert float(got) == pytest.approx(stepped_m(time_s, a, v, 15.0), abs=0.01)


def test_for_ever_is_the_stopping_distance_or_endless() -> None:
    for_ever = np.array(np.inf)

    assert travelled_m(for_ever, np.array(-4.0), np.array(8.0), np.array(15.0)) == 8.0
    assert travelled_m(for_ever, np.array(1.0), np.array(8.0), np.array(15.0)) == np.inf


@given(time_s=times, a=accelerations, v=speeds)
def test_reached_after_undoes_travelled(time_s: float, a: float, v: float) -> None:
    top = np.array(40.0)
    d = travelled_m(np.array(time_s), np.array(a), np.array(v), top)
    assume(float(v) + a * time_s > 0.01)
    assume(float(d) > 1e-6)

    assert float(reached_after_s(d, np.array(a), np.array(v), top)) == pytest.approx(
        time_s, rel=1e-6, abs=1e-6
    )


@given(time_s=times, a=accelerations, v=speeds)
def test_acceleration_to_cover_undoes_travelled(time_s: float, a: float, v: float) -> None:
    top = np.array(40.0)
    d = travelled_m(np.array(time_s), np.array(a), np.array(v), top)
    needed = acceleration_to_cover(d, np.array(time_s), np.array(v), top)
    assume(np.isfinite(needed))

    again = travelled_m(np.array(time_s), needed, np.array(v), top)
    assert float(again) == pytest.approx(float(d), rel=1e-6, abs=1e-6)


def test_a_distance_behind_is_reached_already_by_any_acceleration() -> None:
    behind, v, top = np.array(-1.0), np.array(5.0), np.array(15.0)

    assert reached_after_s(behind, np.array(-9.0), v, top) == 0.0
    assert acceleration_to_cover(behind, np.array(3.0), v, top) == -np.inf


def test_too_far_for_the_top_speed_is_out_of_reach() -> None:
    assert (
        acceleration_to_cover(np.array(46.0), np.array(3.0), np.array(5.0), np.array(15.0))
        == np.inf
    )
