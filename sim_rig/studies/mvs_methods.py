"""What the same evidence gives when it is fused in other ways: the yardsticks of MVS.

Each takes the evidence of one car and returns state (4) and covariance (4, 4) at `now_ms`, UTC;
q is the density of the acceleration noise, m^2/s^3.
"""

from collections.abc import Sequence

import numpy as np

from onboard.kinematics.arrays import Array
from onboard.tracking.evidence import Estimate, Evidence, Measurement
from onboard.tracking.fusion import fuse, propagate

OMEGAS = np.linspace(0.0, 1.0, 21)


def use_all(evidence: Sequence[Evidence], now_ms: int, q: float) -> tuple[Array, Array]:
    """Use every piece as if it were independent of all others.

    Of measurements that are each given once this is the centralised filter; of evidence that
    overlaps it is the blind one.
    """
    states, covariances = propagate(fuse([evidence], q), now_ms, q)
    return states[:, 0], covariances[:, :, 0]


def covariance_intersection(
    evidence: Sequence[Evidence], now_ms: int, q: float
) -> tuple[Array, Array]:
    """Filter the measurements; intersect what comes of it with each estimate, the newest first.

    Covariance intersection (Julier and Uhlmann, 1997) is consistent whatever two estimates share:
    P^-1 = w A^-1 + (1 - w) B^-1, with the w that makes the determinant of P least.
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
