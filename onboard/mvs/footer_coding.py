"""Encoding of evidence as a footer."""

from collections import Counter, defaultdict
from collections.abc import Container, Iterable, Sequence
from functools import cache, partial
from typing import Any

import numpy as np

from onboard.kinematics.arrays import Array
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import mvs_footer
from onboard.messages.mvs_footer import (
    MAX_AGE_MS,
    MAX_OBSERVERS,
    MAX_RUN,
    OBSERVER_BYTES,
    MvsFooter,
    ObserverRun,
    SharedEstimate,
    SharedMeasurement,
    SharedState,
)
from onboard.tracking.evidence import (
    Evidence,
    Measurement,
    Provenance,
    measured_ms,
    observer_numbers_of,
    observer_of,
    observers_and_times,
)

_NUMBERS = 256
"""Numbers of vehicles on the air."""

Entry = tuple[int, Evidence]
"""The sender's number for a vehicle, and an ME of it."""


def free_number(number: int, used: Container[int | None]) -> int:
    """Return a number on the air for the track `number`, not in `used` while one is free.

    Two vehicles under one number would replace each other with every footer.
    """
    wanted = ((number + offset) % _NUMBERS for offset in range(_NUMBERS))
    return next((free for free in wanted if free not in used), number % _NUMBERS)


def footer_of(
    entries: Iterable[Entry], reference_ms: int, frame: LocalFrame, anchor: LocalFrame
) -> MvsFooter:
    """Return the footer that carries `entries`.

    Args:
        entries: MEs in `frame`.
        reference_ms: reference time, UTC; not before the last measurement and at most 4,095 ms
            after the first.
        frame: of `entries`.
        anchor: frame of the footer.
    """
    mapping = anchor.mapping_from(frame)
    observers: dict[bytes, int] = {}
    measurements, estimates = [], []
    for number, piece in ((number, piece.mapped(*mapping)) for number, piece in entries):
        sigmas, correlations = to_correlations(piece.covariance)
        if isinstance(piece, Measurement):
            east_m, north_m = piece.position_m.tolist()
            measurements.append(
                SharedMeasurement(
                    observers.setdefault(observer_of(piece.id), len(observers)),
                    number % _NUMBERS,
                    reference_ms - piece.stamp_ms,
                    0,
                    east_m,
                    north_m,
                    *sigmas,
                    *correlations,
                )
            )
        else:
            runs = runs_of(piece.provenance, reference_ms, observers)
            numbers: list[Any] = [*piece.state.tolist(), *sigmas, *correlations, len(runs)]
            estimates.append(SharedEstimate(SharedState(number % _NUMBERS, *numbers), runs))
    return MvsFooter(
        reference_ms,
        anchor.latitude_deg,
        anchor.longitude_deg,
        tuple(observers),
        tuple(measurements),
        tuple(estimates),
    )


def encode_within(
    entries: Sequence[Entry],
    reference_ms: int,
    frame: LocalFrame,
    anchor: LocalFrame,
    max_bytes: int,
) -> tuple[bytes, list[Entry]]:
    """Encode the first of `entries`, as many as fit.

    Args:
        entries: MEs in `frame`, the most important first.
        reference_ms: reference time, UTC.
        frame: of `entries`.
        anchor: frame of the footer.
        max_bytes: size of the footer.

    Returns:
        the footer, and the entries in it.
    """
    fitting = fitting_entries(entries, reference_ms, max_bytes)
    return mvs_footer.encode(footer_of(fitting, reference_ms, frame, anchor)), fitting


def fitting_entries(entries: Sequence[Entry], reference_ms: int, max_bytes: int) -> list[Entry]:
    """Return the first of `entries` that fit, without those too old for a footer or not yet made.

    Arguments as of `encode_within`.
    """
    timely = [
        (number, piece)
        for number, piece in entries
        if all(0 <= reference_ms - measured_ms(each) <= MAX_AGE_MS for each in piece.provenance)
    ]
    return timely[: _count_within(timely, max_bytes)]


def _count_within(entries: Sequence[Entry], max_bytes: int) -> int:
    """Return how many of the first entries fit into a footer."""
    named: set[int] = set()
    left_bytes = max_bytes - mvs_footer.HEADER.size_bytes
    for count, (_, piece) in enumerate(entries):
        measured = Counter(observer_numbers_of(piece.provenance))
        left_bytes -= OBSERVER_BYTES * len(measured.keys() - named)
        named |= measured.keys()
        left_bytes -= (
            mvs_footer.MEASUREMENT.size_bytes
            if isinstance(piece, Measurement)
            else mvs_footer.size_of_estimate(measured.values())
        )
        if left_bytes < 0 or len(named) > MAX_OBSERVERS:
            return count
    return len(entries)


def runs_of(
    provenance: Provenance, reference_ms: int, observers: dict[bytes, int]
) -> tuple[ObserverRun, ...]:
    """Return a provenance by observers, which are added to the table of them.

    Args:
        provenance: of an estimate.
        reference_ms: UTC from which ages count back.
        observers: index of each in the table.
    """
    ages_of: dict[bytes, list[int]] = defaultdict(list)
    for observer, stamp_ms in observers_and_times(provenance):
        ages_of[observer].append(reference_ms - stamp_ms)
    return tuple(
        ObserverRun(
            observers.setdefault(observer, len(observers)), tuple(ages_ms[at : at + MAX_RUN])
        )
        for observer, ages_ms in ages_of.items()
        for at in range(0, len(ages_ms), MAX_RUN)
    )


def to_correlations(covariance: Array) -> tuple[list[float], list[float]]:
    """Split a covariance (n, n) into n standard deviations and n (n - 1) / 2 partial correlations.

    With L the Cholesky factor of the correlation matrix, row i of which has length 1, the partial
    correlation ij is L_ij over the length that the entries before it leave.
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
    """Return M covariances (M, n, n), positive for correlations between -1 and 1.

    Args:
        sigmas: (M, n).
        correlations: (M, n (n - 1) / 2).
    """
    m, n = sigmas.shape
    factor = np.zeros((m, n, n))
    factor[:, *_below_diagonal(n)] = correlations
    left = np.ones((m, n))  # of the length of each row, as in `to_correlations`
    for j in range(n - 1):
        factor[:, j + 1 :, j] *= np.sqrt(left[:, j + 1 :])
        left[:, j + 1 :] -= factor[:, j + 1 :, j] ** 2
    factor[:, range(n), range(n)] = np.sqrt(left)
    scaled = sigmas[:, :, None] * factor
    covariances: Array = scaled @ scaled.transpose(0, 2, 1)
    return covariances


_below_diagonal = cache(partial(np.tril_indices, k=-1))
