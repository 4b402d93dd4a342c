"""Fusing the evidence of a car: order, lateness, mixed models, many cars at once."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from onboard.tracking.evidence import (
    Estimate,
    Evidence,
    Measurement,
    measurement_id,
    observers_and_times,
)
from onboard.tracking.fusion import fuse, propagate

Q = 1.0


def measurement(observer: str, stamp_ms: int, x_m: float, y_m: float = 0.0) -> Measurement:
    return Measurement(
        measurement_id(observer.encode(), stamp_ms), np.array([x_m, y_m]), np.eye(2) * 0.25
    )


def by_least_squares(measurements: list[Measurement]) -> tuple[np.ndarray, np.ndarray]:
    """The same estimate without a filter: all positions and all steps in one equation."""
    ordered = sorted(measurements, key=lambda m: m.stamp_ms)
    n = len(ordered)
    information, vector = np.zeros((4 * n, 4 * n)), np.zeros(4 * n)
    information[:4, :4] += np.diag([0, 0, 1e-4, 1e-4])  # 100 m/s: the speed is not known
    for k, m in enumerate(ordered):
        here = slice(4 * k, 4 * k + 2)
        information[here, here] += np.linalg.inv(m.covariance)
        vector[here] += np.linalg.inv(m.covariance) @ m.position_m
        if k:
            dt = (m.stamp_ms - ordered[k - 1].stamp_ms) / 1000
            axis = Q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
            step = np.hstack([-np.kron([[1, dt], [0, 1]], np.eye(2)), np.eye(4)])
            pair = slice(4 * k - 4, 4 * k + 4)
            information[pair, pair] += step.T @ np.linalg.inv(np.kron(axis, np.eye(2))) @ step
    covariance = np.linalg.inv(information)
    return (covariance @ vector)[-4:], covariance[-4:, -4:]


measured = st.lists(
    st.tuples(st.integers(0, 3), st.integers(1, 40), st.floats(-5, 5), st.floats(-5, 5)),
    min_size=1, max_size=12, unique_by=lambda m: m[1],
)  # fmt: skip


@given(measured, st.randoms())
def test_measurements_in_any_order_give_the_least_squares_estimate(
    pieces: list[tuple[int, int, float, float]], random: object
) -> None:
    evidence = [measurement(str(o), 100 * t, 10.0 * t / 10 + x, y) for o, t, x, y in pieces]
    shuffled = list(evidence)
    random.shuffle(shuffled)  # type: ignore[attr-defined]

    (estimate,) = fuse([shuffled], Q)

    state, covariance = by_least_squares(evidence)
    np.testing.assert_allclose(estimate.state, state, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(estimate.covariance, covariance, rtol=1e-5, atol=1e-7)
    assert estimate.provenance == {piece.id for piece in evidence}
    assert estimate.stamp_ms == max(piece.stamp_ms for piece in evidence)


def test_measurements_of_the_same_moment_are_both_used() -> None:
    (one,) = fuse([[measurement("a", 100, 1.0)]], Q)
    (two,) = fuse([[measurement("a", 100, 1.0), measurement("b", 100, 2.0)]], Q)

    np.testing.assert_allclose(two.state[:2], [1.5, 0.0])
    np.testing.assert_allclose(two.covariance[:2, :2], one.covariance[:2, :2] / 2)


def test_an_estimate_followed_by_measurements_is_all_the_measurements() -> None:
    """Nothing is lost by sending an estimate in place of what it was made from."""
    early = [measurement("a", 100 * k, 1.5 * k, 0.1 * k * k) for k in range(5)]
    late = [measurement("b", 500 + 100 * k, 7.5 + 1.5 * k) for k in range(3)]

    (passed_on,) = fuse([early], Q)
    (from_estimate,) = fuse([[*late, passed_on]], Q)
    (from_all,) = fuse([early + late], Q)

    np.testing.assert_allclose(from_estimate.state, from_all.state)
    np.testing.assert_allclose(from_estimate.covariance, from_all.covariance)
    assert from_estimate.provenance == from_all.provenance


def test_many_cars_at_once_are_each_car_alone() -> None:
    rng = np.random.default_rng(0)
    cars: list[list[Evidence]] = []
    for n in (1, 6, 3, 9):
        evidence: list[Evidence] = [
            measurement("a", int(stamp), *rng.normal(size=2))
            for stamp in rng.choice(2000, size=n, replace=False)
        ]
        evidence += fuse([[measurement("b", int(rng.integers(2000)), *rng.normal(size=2))]], Q)
        cars.append(evidence)

    together = fuse(cars, Q)

    for estimate, evidence in zip(together, cars, strict=True):
        (alone,) = fuse([evidence], Q)
        np.testing.assert_allclose(estimate.state, alone.state)
        np.testing.assert_allclose(estimate.covariance, alone.covariance)


def test_estimates_are_carried_to_now_and_grow_uncertain() -> None:
    (estimate,) = fuse([[measurement("a", 100 * k, 1.0 * k) for k in range(20)]], Q)

    states, covariances = propagate([estimate], 2400, Q)

    np.testing.assert_allclose(states[:, 0], [24.0, 0.0, 10.0, 0.0], atol=0.01)
    assert (np.diagonal(covariances[:, :, 0]) > np.diagonal(estimate.covariance)).all()


def test_an_estimate_from_the_future_is_not_carried_back() -> None:
    (estimate,) = fuse([[measurement("a", 1000, 5.0)]], Q)

    states, _ = propagate([estimate], 900, Q)

    np.testing.assert_array_equal(states[:, 0], estimate.state)


def test_no_cars_no_estimates() -> None:
    assert fuse([], Q) == []
    assert propagate([], 0, Q)[0].shape == (4, 0)


def test_provenance_of_an_estimate_of_estimates_lists_the_measurements() -> None:
    (first,) = fuse([[measurement("a", 100, 0.0), measurement("b", 150, 0.0)]], Q)
    (second,) = fuse([[first, measurement("c", 200, 0.0)]], Q)

    assert isinstance(second, Estimate)
    assert observers_and_times(second.provenance) == [
        (b"\0\0\0a", 100), (b"\0\0\0b", 150), (b"\0\0\0c", 200)
    ]  # fmt: skip
