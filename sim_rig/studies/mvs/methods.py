"""Other methods to fuse the same evidence, for comparison with MVS.

Each takes the evidence of one car and returns state (4,) and covariance (4, 4) at `now_ms`.
"""

from collections.abc import Sequence

import numpy as np

from onboard.kinematics.arrays import Array
from onboard.tracking.evidence import Estimate, Evidence, Measurement
from onboard.tracking.fusion import fuse, propagate

OMEGAS = np.linspace(0.0, 1.0, 21)


def use_all(evidence: Sequence[Evidence], now_ms: int, q: float) -> tuple[Array, Array]:
    """Fuse all evidence as if every piece were independent of the others.

    Given each measurement once, this is the centralised filter; given estimates that share
    measurements, it counts those again.

    Args:
        evidence: measurements and estimates of one car.
        now_ms: UTC time of the result, in ms.
        q: density of the acceleration noise, m^2/s^3.
    """
    states, covariances = propagate(fuse([evidence], q), now_ms, q)
    return states[:, 0], covariances[:, :, 0]


def covariance_intersection(
    evidence: Sequence[Evidence], now_ms: int, q: float
) -> tuple[Array, Array]:
    """Filter the measurements, and intersect the result with each estimate, the newest first.

    Covariance intersection (Julier and Uhlmann, 1997) is consistent for any correlation of two
    estimates: P^-1 = w A^-1 + (1 - w) B^-1, with the w that minimises the determinant of P.

    Args:
        evidence: measurements and estimates of one car.
        now_ms: UTC time of the result, in ms.
        q: density of the acceleration noise, m^2/s^3.
    """
    measurements = [piece for piece in evidence if isinstance(piece, Measurement)]
    received = [piece for piece in evidence if isinstance(piece, Estimate)]
    parts = fuse([measurements], q) if measurements else []
    parts += sorted(received, key=lambda piece: -piece.stamp_ms)
    states, covariances = propagate(parts, now_ms, q)
    state, covariance = states[:, 0], covariances[:, :, 0]
    for at in range(1, len(parts)):
        state, covariance = _intersect(state, covariance, states[:, at], covariances[:, :, at])
    return state, covariance


def _intersect(a: Array, a_covariance: Array, b: Array, b_covariance: Array) -> tuple[Array, Array]:
    a_information, b_information = np.linalg.inv(a_covariance), np.linalg.inv(b_covariance)
    mixed = OMEGAS[:, None, None] * a_information + (1 - OMEGAS)[:, None, None] * b_information
    omega = OMEGAS[np.argmax(np.linalg.det(mixed))]
    covariance = np.linalg.inv(omega * a_information + (1 - omega) * b_information)
    return covariance @ (omega * a_information @ a + (1 - omega) * b_information @ b), covariance
