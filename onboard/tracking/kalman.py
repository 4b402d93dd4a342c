"""Constant-velocity Kalman filter in the plane, batched over tracks (section IV-B, eqs. 1 to 4).

The state is x = [px, py, vx, vy], in m and m/s. Between two measurements the speed is constant
but for white acceleration noise of spectral density q (m^2/s^3):

    F = [1 0 dt 0]      Q = q [dt^3/3      0  dt^2/2      0]
        [0 1 0 dt]            [     0 dt^3/3       0 dt^2/2]
        [0 0 1  0]            [dt^2/2      0      dt      0]
        [0 0 0  1]            [     0 dt^2/2       0     dt]

A measurement observes the position only, H = [I 0] (2 x 4). An estimate made by another vehicle
observes the whole state, H = I (4 x 4), with the covariance that its sender gives.

The track is the last axis of every array, so that one step of N tracks is a handful of numpy
operations: states (4, N), covariances (4, 4, N). Updates are in Joseph's form and symmetrised: a
covariance stays symmetric and positive whatever the noise that is put in, as long as that is.
"""

import numpy as np

from onboard.kinematics.arrays import Array

_I2 = np.eye(2)[:, :, None]
_I4 = np.eye(4)


def predict(states: Array, covariances: Array, dt_s: Array, q: float) -> tuple[Array, Array]:
    """Predict N tracks over `dt_s`; eqs. 1 and 2.

    Args:
        states: (4, N).
        covariances: (4, 4, N).
        dt_s: (N) seconds, not negative.
        q: spectral density of the acceleration noise, m^2/s^3.

    Returns:
        predicted states and covariances.
    """
    position, both, velocity = covariances[:2, :2], covariances[:2, 2:], covariances[2:, 2:]
    noise = q * dt_s * _I2
    moved = both + dt_s * velocity
    predicted = np.empty_like(covariances)
    predicted[:2, :2] = position + dt_s * (both.swapaxes(0, 1) + moved + noise * (dt_s / 3))
    predicted[:2, 2:] = moved + noise * (dt_s / 2)
    predicted[2:, :2] = predicted[:2, 2:].swapaxes(0, 1)
    predicted[2:, 2:] = velocity + noise
    carried = states.copy()
    carried[:2] += dt_s * states[2:]
    return carried, predicted


def update_position(
    states: Array, covariances: Array, positions: Array, noises: Array
) -> tuple[Array, Array]:
    """Update N tracks with measured positions; eqs. 3 and 4.

    Args:
        states: (4, N).
        covariances: (4, 4, N).
        positions: (2, N).
        noises: (2, 2, N) covariances of the positions.

    Returns:
        updated states and covariances.
    """
    innovation = covariances[:2, :2] + noises
    a, b, c = innovation[0, 0], innovation[0, 1], innovation[1, 1]
    # K = P H' S^-1, as two columns of (4, N).
    cross = covariances[:, :2] / (a * c - b * b)
    gain_x = cross[:, 0] * c - cross[:, 1] * b
    gain_y = cross[:, 1] * a - cross[:, 0] * b
    residual_x, residual_y = positions - states[:2]
    states = states + gain_x * residual_x + gain_y * residual_y
    # Joseph: (I - K H) P (I - K H)' + K R K'.
    kept = covariances - gain_x[:, None] * covariances[0] - gain_y[:, None] * covariances[1]
    pull_x = gain_x * noises[0, 0] + gain_y * noises[0, 1] - kept[:, 0]
    pull_y = gain_x * noises[1, 0] + gain_y * noises[1, 1] - kept[:, 1]
    kept += pull_x[:, None] * gain_x + pull_y[:, None] * gain_y
    return states, (kept + kept.swapaxes(0, 1)) / 2


def update_state(
    states: Array, covariances: Array, estimates: Array, noises: Array
) -> tuple[Array, Array]:
    """Update N tracks with estimates of the whole state; H is the 4 x 4 identity.

    Args:
        states: (4, N).
        covariances: (4, 4, N).
        estimates: (4, N).
        noises: (4, 4, N) covariances of the estimates.

    Returns:
        updated states and covariances.
    """
    prior, noise = covariances.transpose(2, 0, 1), noises.transpose(2, 0, 1)
    gain = np.linalg.solve(prior + noise, prior).swapaxes(1, 2)
    residual = (estimates - states).T[:, :, None]
    rest = _I4 - gain
    kept = rest @ prior @ rest.swapaxes(1, 2) + gain @ noise @ gain.swapaxes(1, 2)
    symmetric = (kept + kept.swapaxes(1, 2)) / 2
    return states + (gain @ residual)[:, :, 0].T, symmetric.transpose(1, 2, 0)
