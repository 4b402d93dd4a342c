"""Between evidence as the core holds it and the footer as it travels."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from operator import attrgetter
from typing import Any

import numpy as np

from onboard.messages import mvs_footer
from onboard.messages.mvs_footer import (
    LONGEST_AGE_MS,
    LONGEST_RUN,
    MvsFooter,
    Run,
    SharedEstimate,
    SharedMeasurement,
    SharedState,
)
from onboard.mvs.evidence import (
    Estimate,
    Evidence,
    Measurement,
    MeasurementId,
    measurement_id,
    turn_of_state,
)
from onboard.mvs.kalman import Array
from onboard.mvs.local_frame import LocalFrame

MOST_OBSERVERS = 255

_MEASURED = attrgetter(*mvs_footer.MEASUREMENT_NUMBERS)
_STATED = attrgetter(*mvs_footer.STATE_NUMBERS)


def footer_of(
    evidence: Iterable[Evidence], reference_ms: int, frame: LocalFrame, anchor: LocalFrame
) -> MvsFooter:
    """Put `evidence`, given in `frame`, into a footer around `anchor`.

    `reference_ms` is not before the last of its measurements and at most 4,095 ms behind the first.
    """
    mapping = anchor.mapping_from(frame)
    observers: dict[bytes, int] = {}
    measurements, estimates = [], []
    for piece in (piece.mapped(*mapping) for piece in evidence):
        sigmas, correlations = to_correlations(piece.covariance)
        if isinstance(piece, Measurement):
            east_m, north_m = piece.position_m.tolist()
            measurements.append(
                SharedMeasurement(
                    observers.setdefault(piece.id.observer, len(observers)),
                    reference_ms - piece.id.stamp_ms,
                    0,
                    east_m,
                    north_m,
                    *sigmas,
                    *correlations,
                )
            )
        else:
            runs = _runs(piece.provenance, reference_ms, observers)
            numbers: list[Any] = [*piece.state.tolist(), *sigmas, *correlations, len(runs)]
            estimates.append(SharedEstimate(SharedState(*numbers), runs))
    return MvsFooter(
        reference_ms,
        anchor.latitude_deg,
        anchor.longitude_deg,
        tuple(observers),
        tuple(measurements),
        tuple(estimates),
    )


def evidence_in(footer: MvsFooter, frame: LocalFrame) -> list[Evidence]:
    """Read the entries of `footer`, placed in `frame`."""
    turn, shift = frame.mapping_from(LocalFrame(footer.latitude_deg, footer.longitude_deg))
    evidence: list[Evidence] = []
    if footer.measurements:
        numbers = np.array([_MEASURED(shared) for shared in footer.measurements])
        positions = numbers[:, :2] @ turn.T + shift
        covariances = turn @ from_correlations(numbers[:, 2:4], numbers[:, 4:]) @ turn.T
        for at, shared in enumerate(footer.measurements):
            stamp_ms = footer.reference_ms - shared.age_ms
            identity = measurement_id(footer.observers[shared.observer], stamp_ms)
            evidence.append(Measurement(identity, positions[at], covariances[at]))
    if footer.estimates:
        numbers = np.array([_STATED(estimate.state) for estimate in footer.estimates])
        both = turn_of_state(turn)
        states = numbers[:, :4] @ both.T
        states[:, :2] += shift
        covariances = both @ from_correlations(numbers[:, 4:8], numbers[:, 8:]) @ both.T
        for at, estimate in enumerate(footer.estimates):
            provenance = frozenset(
                [
                    measurement_id(footer.observers[run.observer], footer.reference_ms - age_ms)
                    for run in estimate.provenance
                    for age_ms in run.ages_ms
                ]
            )
            evidence.append(Estimate(provenance, states[at], covariances[at]))
    return evidence


def encode_within(
    evidence: Sequence[Evidence],
    reference_ms: int,
    frame: LocalFrame,
    anchor: LocalFrame,
    most_bytes: int,
) -> bytes:
    """Encode as many of `evidence`, the first ones first, as `most_bytes` hold."""
    fitting = [
        piece
        for piece in evidence
        if all(0 <= reference_ms - stamp_ms <= LONGEST_AGE_MS for _, stamp_ms in piece.provenance)
    ]
    while True:
        names = {observer for piece in fitting for observer, _ in piece.provenance}
        if len(names) <= MOST_OBSERVERS:
            data = mvs_footer.encode(footer_of(fitting, reference_ms, frame, anchor))
            if len(data) <= most_bytes or not fitting:
                return data
        fitting.pop()


def _runs(
    provenance: Iterable[MeasurementId], reference_ms: int, observers: dict[bytes, int]
) -> tuple[Run, ...]:
    ages_of: dict[bytes, list[int]] = defaultdict(list)
    for observer, stamp_ms in sorted(provenance):
        ages_of[observer].append(reference_ms - stamp_ms)
    return tuple(
        Run(observers.setdefault(observer, len(observers)), tuple(ages_ms[at : at + LONGEST_RUN]))
        for observer, ages_ms in ages_of.items()
        for at in range(0, len(ages_ms), LONGEST_RUN)
    )


def to_correlations(covariance: Array) -> tuple[list[float], list[float]]:
    """Take a covariance (n, n) apart: n standard deviations, n (n - 1) / 2 partial correlations.

    With L the Cholesky factor of the correlation matrix, row i of which has length 1, the partial
    correlation ij is L_ij by what the entries before it leave of that length.
    """
    sigmas = np.sqrt(np.diagonal(covariance))
    factor = np.linalg.cholesky(covariance / np.outer(sigmas, sigmas)).tolist()
    correlations = []
    for i in range(1, len(sigmas)):
        left = 1.0
        for j in range(i):
            correlations.append(factor[i][j] / left**0.5 if left > 0.0 else 0.0)
            left -= factor[i][j] ** 2
    return sigmas.tolist(), correlations


def from_correlations(sigmas: Array, correlations: Array) -> Array:
    """Put M covariances (M, n, n) together again; positive for correlations between -1 and 1.

    Args:
        sigmas: (M, n).
        correlations: (M, n (n - 1) / 2).
    """
    many, n = sigmas.shape
    factor = np.zeros((many, n, n))
    each = iter(correlations.T)
    for i in range(n):
        left = np.ones(many)
        for j in range(i):
            factor[:, i, j] = next(each) * np.sqrt(left)
            left -= factor[:, i, j] ** 2
        factor[:, i, i] = np.sqrt(left)
    scaled = sigmas[:, :, None] * factor
    covariances: Array = scaled @ scaled.transpose(0, 2, 1)
    return covariances
