"""Reading of received footers into arrays, many together and so several times as fast as one alone.

A footer of every neighbour arrives ten times a second. A valid one gives the values that
`mvs_footer.decode` gives; any other is left to that, which refuses it with its reason.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from operator import sub

import numpy as np
from numpy.typing import NDArray

from onboard.errors import DecodeError
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import mvs_footer
from onboard.messages.columns import Columns
from onboard.messages.mvs_footer import (
    COUNT_BITS,
    HEADER,
    MAX_AGE_MS,
    MEASUREMENT,
    OBSERVER_BYTES,
    STATE,
    FooterHeader,
)
from onboard.mvs.footer_coding import from_correlations
from onboard.mvs.received_footers import SharedEntries
from onboard.tracking.evidence import MeasurementId, ProvenanceSpans, measurement_id
from onboard.tracking.slices import result_of

_MEASUREMENTS = Columns(MEASUREMENT)
_STATES = Columns(STATE)

_COUNT_MASK = (1 << COUNT_BITS) - 1
_WORD = 3
"""Half bytes in an age, and in observer and count of a run."""
_WORD_MASK = (1 << 4 * _WORD) - 1
_RUN_SIZES = {f"{count:x}": _WORD * (count + 2) for count in range(1 << COUNT_BITS)}
"""Half bytes of a run by the half byte that has its count."""

_Integers = NDArray[np.int64]


class _InvalidError(Exception):
    """The footer is not valid."""


@dataclass(frozen=True, slots=True, eq=False)
class _Footer:
    """Where the parts of a footer are."""

    data: bytes
    header: FooterHeader
    observers: list[bytes]
    measurements: bytes
    states: list[bytes]
    runs: list[int]
    """Half bytes at which the runs of all its estimates begin."""


def read(data: bytes) -> SharedEntries:
    """Decode the entries of a footer, measurements first.

    Raises:
        DecodeError: those of `mvs_footer.decode`.
    """
    (entries,) = read_together([data])
    if isinstance(entries, DecodeError):
        raise entries
    return entries


def read_together(footers: Sequence[bytes]) -> list[SharedEntries | DecodeError]:
    """Decode each footer as `read` does, or return why it is refused."""
    return result_of(read_in_slices(footers))


def read_in_slices(
    footers: Sequence[bytes],
) -> Generator[None, None, list[SharedEntries | DecodeError]]:
    """Do what `read_together` does in two slices."""
    parted = [_parted(data) for data in footers]
    entries = iter((yield from _entries([footer for footer in parted if footer is not None])))
    read_of = [None if footer is None else next(entries) for footer in parted]
    return [
        _refusal(data) if of_footer is None else of_footer
        for data, of_footer in zip(footers, read_of, strict=True)
    ]


def _refusal(data: bytes) -> DecodeError:
    try:
        mvs_footer.decode(data)
    except DecodeError as error:
        return error
    return DecodeError("out_of_range", "the footer")


def _parted(data: bytes) -> _Footer | None:
    """Find the parts of a footer; `None` if it does not end where the last one does."""
    if data[:1] != bytes([mvs_footer.VERSION]):
        return None
    try:
        header = HEADER.decode(data[: HEADER.size_bytes])
    except DecodeError:
        return None
    if header.reference_ms < MAX_AGE_MS:
        return None
    measured_at = HEADER.size_bytes + OBSERVER_BYTES * header.observers
    stated_at = measured_at + MEASUREMENT.size_bytes * header.measurements
    try:
        states, runs = _part_estimates(data, stated_at, header.estimates)
    except (_InvalidError, IndexError):
        return None
    observers = [
        data[at : at + OBSERVER_BYTES]
        for at in range(HEADER.size_bytes, measured_at, OBSERVER_BYTES)
    ]
    return _Footer(data, header, observers, data[measured_at:stated_at], states, runs)


def _part_estimates(data: bytes, at: int, estimates: int) -> tuple[list[bytes], list[int]]:
    """Return the states of the estimates, encoded, and the half bytes at which runs begin.

    Args:
        data: the footer.
        at: where the first estimate begins.
        estimates: number of them, behind which the footer ends.
    """
    half_bytes = data.hex()
    states, runs = [], []
    for _ in range(estimates):
        states.append(data[at : at + STATE.size_bytes])
        at += STATE.size_bytes
        count = data[at - 1]  # the last field of the state
        if not count:
            raise _InvalidError
        half_byte = 2 * at
        for _ in range(count):
            runs.append(half_byte)
            half_byte += _RUN_SIZES[half_bytes[half_byte + _WORD - 1]]
        if half_byte % 2:
            if half_bytes[half_byte] != "0":  # padding
                raise _InvalidError
            half_byte += 1
        at = half_byte // 2
    if at != len(data):
        raise _InvalidError
    return states, runs


def _entries(
    footers: Sequence[_Footer],
) -> Generator[None, None, list[SharedEntries | None]]:
    """Return in two slices the entries of each footer; `None` where a value is not valid."""
    if not footers:
        return []
    headers = [footer.header for footer in footers]
    measured = _MEASUREMENTS.read(b"".join([footer.measurements for footer in footers]))
    stated = _STATES.read(b"".join([state for footer in footers for state in footer.states]))
    n = len(measured)
    measured_in = np.repeat(np.arange(len(footers)), [each.measurements for each in headers])
    stated_in = np.repeat(np.arange(len(footers)), [each.estimates for each in headers])
    entry_in = np.concatenate([measured_in, stated_in])
    values = np.zeros((n + len(stated), stated.shape[1] - 1))
    values[n:] = stated[:, :-1]
    values[:n, [0, 1, 2, 5, 6, 9]] = measured[:, [1, 4, 5, 6, 7, 8]]
    # A measurement is a run of one.
    observers, sizes, ages_ms = (
        np.concatenate([of_measured.astype(np.int64), of_runs])
        for of_measured, of_runs in zip(
            (measured[:, 0], np.ones(n), measured[:, 2]), _runs(footers), strict=True
        )
    )
    runs = np.concatenate([np.ones(n, np.int64), stated[:, -1].astype(np.int64)])
    counts = np.add.reduceat(sizes, np.cumsum(runs) - runs) if len(runs) else runs
    run_in = entry_in.repeat(runs)
    identities, is_unknown = _identities(footers, run_in, observers, sizes, ages_ms)
    yield
    ends = np.cumsum(counts).tolist()
    provenances = [frozenset(identities[start:end]) for start, end in pairwise([0, *ends])]
    is_repeated = np.array([len(each) for each in provenances], np.int64) != counts
    references_ms = np.array([each.reference_ms for each in headers])[entry_in]
    spans = ProvenanceSpans.of_stamps(counts, references_ms.repeat(counts) - ages_ms)
    covariances = from_correlations(values[:, 5:9], values[:, 9:])

    is_invalid = np.zeros(len(footers), np.bool_)
    is_invalid[entry_in[is_repeated | np.isnan(values).any(axis=1)]] = True
    is_invalid[run_in[is_unknown]] = True
    order = entry_in.argsort(kind="stable")  # in each footer the measurements stay the first
    places = order.tolist()
    ends = np.cumsum(np.bincount(entry_in, minlength=len(footers))).tolist()
    entries: list[SharedEntries | None] = []
    for footer, invalid, start, end in zip(
        footers, is_invalid.tolist(), [0, *ends], ends, strict=False
    ):
        rows = order[start:end]
        entries.append(
            None
            if invalid
            else SharedEntries(
                LocalFrame(footer.header.latitude_deg, footer.header.longitude_deg),
                tuple(values[rows, 0].astype(np.int64).tolist()),
                tuple([provenances[at] for at in places[start:end]]),
                frozenset(footer.observers),
                spans[rows],
                states=values[rows, 1:5],
                covariances=covariances[rows],
                has_speed=(rows >= n).astype(np.float64),
            )
        )
    return entries


def _runs(footers: Sequence[_Footer]) -> tuple[_Integers, _Integers, _Integers]:
    """Return observer and size of each run of all footers, and the ages in ms in all runs."""
    octets = np.frombuffer(b"".join([footer.data for footer in footers]), np.uint8)
    octets = octets.astype(np.int64)

    def words(half_bytes: _Integers) -> _Integers:
        """Return the 12 bits that begin at each half byte."""
        pairs = octets[half_bytes >> 1] << 8 | octets[(half_bytes >> 1) + 1]
        aligned: _Integers = pairs >> 4 * (1 - (half_bytes & 1)) & _WORD_MASK
        return aligned

    lengths = np.array([len(footer.data) for footer in footers])
    begins = np.repeat(2 * (np.cumsum(lengths) - lengths), [len(each.runs) for each in footers])
    begins += np.array([run for footer in footers for run in footer.runs], np.int64)
    heads = words(begins)
    sizes = (heads & _COUNT_MASK) + 1
    before = np.cumsum(sizes) - sizes
    ages_at = (begins + _WORD * (1 - before)).repeat(sizes) + _WORD * np.arange(sizes.sum())
    return heads >> COUNT_BITS, sizes, words(ages_at)


def _identities(
    footers: Sequence[_Footer],
    run_in: _Integers,
    observers: _Integers,
    sizes: _Integers,
    ages_ms: _Integers,
) -> tuple[list[MeasurementId], NDArray[np.bool_]]:
    """Return the measurements in all runs, and whether the footer of each run lacks its observer.

    Args:
        footers: all.
        run_in: the footer of each run.
        observers: of each run, its place in the table of its footer.
        sizes: of each run.
        ages_ms: of the measurements in all runs.
    """
    known = np.array([len(footer.observers) for footer in footers])
    at_reference = [
        measurement_id(observer, footer.header.reference_ms)
        for footer in footers
        for observer in footer.observers
    ]
    is_unknown = observers >= known[run_in]
    places = (np.cumsum(known) - known)[run_in] + observers
    places[is_unknown] = len(at_reference)
    at_reference.append(0)
    of_runs = map(at_reference.__getitem__, places.repeat(sizes).tolist())
    return list(map(sub, of_runs, ages_ms.tolist())), is_unknown
