"""Constant-velocity Kalman filter in the plane, batched over tracks (section IV-B, eqs. 1 to 4).

The state is x = [px, py, vx, vy], in m and m/s. Between two measurements the speed is constant
but for white acceleration noise of spectral density q (m^2/s^3):

    F = [1 0 dt 0]      Q = q [dt^3/3      0  dt^2/2      0]
        [0 1 0 dt]            [     0 dt^3/3       0 dt^2/2]
        [0 0 1  0]            [dt^2/2      0      dt      0]
        [0 0 0  1]            [     0 dt^2/2       0     dt]

A measurement observes the position only, H = [I 0] (2 x 4). An estimate made by another vehicle
observes the whole state, H = I (4 x 4), with the covariance that its sender gives.

Both are used alike, so that one step of N tracks is a dozen numpy operations whatever is observed:
of a measurement, the columns of the gain for the speed are 0. Updates are in Joseph's form and
symmetrised: a covariance stays symmetric and positive whatever the noise that is put in, as long
as that is.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from onboard.kinematics.arrays import Array, StateArrays

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


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """N steps of the filter, each of a track: a prediction and what is then observed."""

    transitions: Array
    """F (N, 4, 4)"""
    noises: Array
    """Q (N, 4, 4)"""
    observes: Array
    """(N, 1, 4), 1.0 for what is observed, 0.0 for the rest"""
    errors: Array
    """R (N, 4, 4), with the identity for what is not observed"""
    values: Array
    """z (N, 4, 1)"""

    @classmethod
    def of(cls, observed: StateArrays, dt_s: Array, q: float) -> Self:
        """Prepare steps.

        Args:
            observed: N, measurements and estimates, with positive covariances.
            dt_s: (N) seconds since the tracks were last updated.
            q: spectral density of the acceleration noise, m^2/s^3.
        """
        n = len(observed)
        transitions = np.broadcast_to(_I4, (n, 4, 4)).copy()
        transitions[:, [0, 1], [2, 3]] = dt_s[:, None]
        noises = np.zeros((n, 4, 4))
        noises[:, [0, 1], [0, 1]] = (q * dt_s**3 / 3)[:, None]
        noises[:, [0, 1, 2, 3], [2, 3, 0, 1]] = (q * dt_s**2 / 2)[:, None]
        noises[:, [2, 3], [2, 3]] = (q * dt_s)[:, None]
        observes = np.ones((n, 1, 4))
        observes[:, 0, 2:] = observed.has_speed[:, None]
        blocks = observes * observes.swapaxes(1, 2)
        errors = np.where(blocks > 0, observed.covariances.transpose(2, 0, 1), _I4)
        return cls(transitions, noises, observes, errors, observed.states.T[:, :, None])

    def __getitem__(self, rows: slice) -> Self:
        """Return some of the steps."""
        return type(self)(
            self.transitions[rows],
            self.noises[rows],
            self.observes[rows],
            self.errors[rows],
            self.values[rows],
        )


def advance(states: Array, covariances: Array, steps: Steps) -> tuple[Array, Array]:
    """Predict and update N tracks, each by its step.

    Args:
        states: (N, 4, 1).
        covariances: (N, 4, 4).
        steps: N.

    Returns:
        updated states and covariances.
    """
    turned = steps.transitions.swapaxes(1, 2)
    prior = steps.transitions @ covariances @ turned + steps.noises
    crossed = prior * steps.observes  # P H'
    innovation = crossed * steps.observes.swapaxes(1, 2) + steps.errors
    gain = np.linalg.solve(innovation, crossed.swapaxes(1, 2)).swapaxes(1, 2)
    rest = _I4 - gain
    kept = rest @ prior @ rest.swapaxes(1, 2) + gain @ steps.errors @ gain.swapaxes(1, 2)
    predicted = steps.transitions @ states
    updated = predicted + gain @ (steps.values - predicted)
    return updated, (kept + kept.swapaxes(1, 2)) / 2
