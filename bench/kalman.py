"""Track updates a second (prediction and position update), batched, compared with filterpy.

Times are processor times, since the machine is shared.
"""

import time
import timeit
from collections.abc import Iterator
from statistics import median
from typing import Any

import numpy as np
from filterpy.kalman import KalmanFilter

from bench import Figure
from onboard.kinematics.arrays import StateArrays
from onboard.tracking.kalman import Steps, advance

ROUNDS = 7
DT_S, Q = 0.1, 1.0


def measure() -> Iterator[Figure]:
    """Yield updates/s for 1, 10, 100 and 1,000 tracks."""
    rng = np.random.default_rng(0)
    for tracks in (1, 10, 100, 1000):
        states = rng.normal(size=(tracks, 4, 1))
        covariances = np.repeat(np.eye(4)[None], tracks, axis=0)
        positions = np.zeros((4, tracks))
        positions[:2] = rng.normal(size=(2, tracks))
        noises = np.repeat(np.diag([0.25, 0.25, 0.0, 0.0])[:, :, None], tracks, axis=2)
        observed = StateArrays(np.zeros(tracks), positions, noises, np.zeros(tracks))
        dt_s = np.full(tracks, DT_S)
        track = _filterpy_track()
        many, few = max(20, 20_000 // (tracks + 20)), 300

        def batched(
            states: Any = states,
            covariances: Any = covariances,
            dt_s: Any = dt_s,
            observed: Any = observed,
        ) -> None:
            advance(states, covariances, Steps.of(observed, dt_s, Q))

        def by_filterpy(track: Any = track, position: Any = positions[:2, 0]) -> None:
            track.predict()
            track.update(position)

        rates, references = [], []
        for _ in range(ROUNDS):
            rates.append(
                tracks * many / timeit.timeit(batched, timer=time.process_time, number=many)
            )
            references.append(few / timeit.timeit(by_filterpy, timer=time.process_time, number=few))
        yield Figure(
            f"kalman.{tracks}_tracks",
            median(rates),
            "track updates/s",
            ROUNDS,
            "filterpy, one track at a time",
            median(references),
        )


def _filterpy_track() -> Any:
    track = KalmanFilter(dim_x=4, dim_z=2)
    track.F = np.eye(4) + DT_S * np.eye(4, k=2)
    track.H = np.eye(2, 4)
    track.R = 0.25 * np.eye(2)
    axis = Q * np.array([[DT_S**3 / 3, DT_S**2 / 2], [DT_S**2 / 2, DT_S]])
    track.Q = np.kron(axis, np.eye(2))
    return track
