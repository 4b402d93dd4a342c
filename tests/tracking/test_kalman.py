"""The batched filter against filterpy, one track at a time, and against whatever may arrive."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.kinematics.arrays import Array, StateArrays
from onboard.mvs.footer_coding import from_correlations
from onboard.tracking.kalman import Steps, advance, predict

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # its docstrings have invalid escapes
    from filterpy.kalman import KalmanFilter

Q = 1.7


def some_covariances(rng: np.random.Generator, size: int, n: int) -> Array:
    root = rng.normal(size=(size, size, n))
    squares: Array = np.einsum("ikn,jkn->ijn", root, root)
    return squares + 0.01 * np.eye(size)[:, :, None]


def advanced(
    states: Array, covariances: Array, dt_s: Array, z: Array, noise: Array
) -> tuple[Array, Array]:
    """Predict n tracks, and update them with positions (2, n) or whole states (4, n)."""
    size, n = z.shape
    observed = StateArrays(
        np.zeros(n), np.zeros((4, n)), np.zeros((4, 4, n)), np.full(n, float(size == 4))
    )
    observed.states[:size], observed.covariances[:size, :size] = z, noise
    after = advance(
        states.T[:, :, None], covariances.transpose(2, 0, 1), Steps.of(observed, dt_s, Q)
    )
    return after[0][:, :, 0].T, after[1].transpose(1, 2, 0)


def filterpy_track(state: Array, covariance: Array) -> KalmanFilter:
    track = KalmanFilter(dim_x=4, dim_z=2)
    track.x, track.P = state.copy(), covariance.copy()
    return track


def filterpy_predict(track: KalmanFilter, dt: float) -> None:
    transition = np.array([[1, 0, dt, 0], [0, 1, 0, dt], [0, 0, 1, 0], [0, 0, 0, 1]])
    axis = Q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    track.predict(F=transition, Q=np.kron(axis, np.eye(2)))


@pytest.mark.parametrize("n", [1, 7])
def test_many_tracks_at_once_are_filterpy_track_by_track(n: int) -> None:
    rng = np.random.default_rng(n)
    states, covariances = rng.normal(size=(4, n)) * 20, some_covariances(rng, 4, n)
    tracks = [filterpy_track(states[:, i], covariances[:, :, i]) for i in range(n)]

    for step in range(12):
        dt_s = rng.uniform(0, 0.4, n)
        for track, dt in zip(tracks, dt_s, strict=True):
            filterpy_predict(track, dt)
        if step % 3 == 2:
            z, noise = rng.normal(size=(4, n)), some_covariances(rng, 4, n)
            states, covariances = advanced(states, covariances, dt_s, z, noise)
            for i, track in enumerate(tracks):
                track.update(z[:, i], R=noise[:, :, i], H=np.eye(4))
        else:
            z, noise = rng.normal(size=(2, n)), some_covariances(rng, 2, n)
            states, covariances = advanced(states, covariances, dt_s, z, noise)
            for i, track in enumerate(tracks):
                track.update(z[:, i], R=noise[:, :, i], H=np.eye(2, 4))
        for i, track in enumerate(tracks):
            np.testing.assert_allclose(states[:, i], track.x, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(covariances[:, :, i], track.P, rtol=1e-9, atol=1e-9)


def test_states_are_right_with_covariances_as_lopsided_as_can_be_encoded() -> None:
    """Used as information, R^-1, they moved a vehicle by 200 of its standard deviations."""
    rng, n = np.random.default_rng(5), 300
    states, covariances = np.zeros((4, n)), np.diag([1.0, 1.0, 1e4, 1e4])[:, :, None] + np.zeros(n)
    for size in (2, 4, 4, 2):
        dt_s, z = rng.choice([0.0, 0.1, 0.4], n), 10 * rng.normal(size=(size, n))
        noise = from_correlations(
            rng.choice([0.1, 1.0, 20.0, 1900.0], (n, size)),
            rng.choice([-127 / 128, 0.0, 127 / 128], (n, size * (size - 1) // 2)),
        ).transpose(1, 2, 0)
        prior = predict(states, covariances, dt_s, Q)
        states, covariances = advanced(states, covariances, dt_s, z, noise)

        for i in range(n):
            x, p, r = prior[0][:, i], prior[1][:, :, i], noise[:, :, i]
            gain = np.linalg.solve(p[:size, :size] + r, p[:size]).T
            rest = np.eye(4) - gain @ np.eye(size, 4)
            expected = rest @ p @ rest.T + gain @ r @ gain.T
            sigmas_of = np.sqrt(np.diagonal(expected))
            off = (x + gain @ (z[:, i] - x[:size]) - states[:, i]) / sigmas_of
            assert np.abs(off).max() < 1e-5
            off = (expected - covariances[:, :, i]) / np.outer(sigmas_of, sigmas_of)
            assert np.abs(off).max() < 1e-5


sigmas = st.floats(1e-3, 1e3)
correlations = st.floats(-0.999, 0.999)


@given(
    st.lists(
        st.tuples(sigmas, sigmas, correlations, st.floats(0, 10), st.booleans()),
        min_size=1,
        max_size=40,
    )
)
def test_a_covariance_stays_finite_symmetric_and_positive(
    pieces: list[tuple[float, float, float, float, bool]],
) -> None:
    states, covariances = np.zeros((4, 1)), np.eye(4)[:, :, None] * 1e4
    for sigma_x, sigma_y, correlation, dt, whole in pieces:
        cross = correlation * sigma_x * sigma_y
        noise = np.array([[sigma_x**2, cross], [cross, sigma_y**2]])
        size = 4 if whole else 2
        noise = np.kron(np.eye(size // 2), noise)[:, :, None]
        states, covariances = advanced(
            states, covariances, np.array([dt]), np.full((size, 1), 50.0), noise
        )
        assert np.isfinite(states).all()
        covariance = covariances[:, :, 0]
        assert (covariance == covariance.T).all()
        eigenvalues = np.linalg.eigvalsh(covariance)
        assert eigenvalues[0] > -1e-12 * eigenvalues[-1]


def test_two_short_predictions_are_one_long_one() -> None:
    rng = np.random.default_rng(3)
    start = rng.normal(size=(4, 5)), some_covariances(rng, 4, 5)

    once = predict(*start, np.full(5, 0.7), Q)
    twice = predict(*predict(*start, np.full(5, 0.3), Q), np.full(5, 0.4), Q)

    np.testing.assert_allclose(once[0], twice[0])
    np.testing.assert_allclose(once[1], twice[1])


def test_arguments_are_left_as_they_were() -> None:
    rng = np.random.default_rng(4)
    states, covariances = rng.normal(size=(4, 3)), some_covariances(rng, 4, 3)
    kept = states.copy(), covariances.copy()

    predict(states, covariances, np.full(3, 0.1), Q)
    advanced(states, covariances, np.full(3, 0.1), states[:2], covariances[:2, :2])
    advanced(states, covariances, np.full(3, 0.1), states, covariances)

    assert (states == kept[0]).all()
    assert (covariances == kept[1]).all()
