"""Reading of received footers into arrays, several times as fast as `mvs_footer.decode`.

A footer of every neighbour arrives ten times a second. A valid one gives the same values here;
any other is left to `mvs_footer.decode`, which refuses it with its reason.
"""

from itertools import pairwise
from operator import sub

import numpy as np

from onboard.errors import DecodeError
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import mvs_footer
from onboard.messages.columns import Columns
from onboard.messages.mvs_footer import COUNT_BITS, HEADER, MEASUREMENT, OBSERVER_BYTES, STATE
from onboard.mvs.footer_coding import from_correlations
from onboard.mvs.received_footers import SharedEntries
from onboard.tracking.evidence import MeasurementId, Provenance, measurement_id

_MEASUREMENTS = Columns(MEASUREMENT)
_STATES = Columns(STATE)

_COUNT_MASK = (1 << COUNT_BITS) - 1
_WORD = 3
"""Half bytes in an age, and in observer and count of a run."""


class _InvalidError(Exception):
    """The footer is not valid."""


def read(data: bytes) -> SharedEntries:
    """Decode the entries of a footer, measurements first.

    Raises:
        DecodeError: those of `mvs_footer.decode`.
    """
    try:
        return _read(data)
    except (_InvalidError, IndexError, DecodeError):
        mvs_footer.decode(data)
        raise DecodeError("out_of_range", "the footer") from None


def _read(data: bytes) -> SharedEntries:
    if data[0] != mvs_footer.VERSION:
        raise _InvalidError
    header = HEADER.decode(data[: HEADER.size_bytes])
    measured_at = HEADER.size_bytes + OBSERVER_BYTES * header.observers
    stated_at = measured_at + MEASUREMENT.size_bytes * header.measurements
    observers = [
        data[at : at + OBSERVER_BYTES]
        for at in range(HEADER.size_bytes, measured_at, OBSERVER_BYTES)
    ]
    at_reference = [measurement_id(observer, header.reference_ms) for observer in observers]
    states, of_estimates = _read_estimates(data, stated_at, header.estimates, at_reference)
    provenances: list[Provenance] = []
    n = header.measurements
    entries = np.zeros((n + header.estimates, len(STATE.fields) - 1))
    entries[n:] = _STATES.read(states)[:, :-1]
    if n:
        measured = _MEASUREMENTS.read(data[measured_at:stated_at])
        entries[:n, [0, 1, 2, 5, 6, 9]] = measured[:, [1, 4, 5, 6, 7, 8]]
        provenances = [
            frozenset((at_reference[int(observer)] - int(age_ms),))
            for observer, age_ms in measured[:, [0, 2]].tolist()
        ]
    return SharedEntries(
        LocalFrame(header.latitude_deg, header.longitude_deg),
        tuple(map(int, entries[:, 0].tolist())),
        (*provenances, *of_estimates),
        frozenset(observers),
        states=entries[:, 1:5],
        covariances=from_correlations(entries[:, 5:9], entries[:, 9:]),
        has_speed=np.repeat([0.0, 1.0], [n, header.estimates]),
    )


def _read_estimates(
    data: bytes, at: int, count: int, at_reference: list[MeasurementId]
) -> tuple[bytes, list[Provenance]]:
    """Return the states of the estimates, still encoded, and their provenances.

    Args:
        data: the footer.
        at: where the first estimate begins.
        count: of estimates.
        at_reference: what each observer would have measured at the reference time.
    """
    words = _words(data) if count else []
    states = []
    from_ids: list[MeasurementId] = []
    ages_ms: list[int] = []
    ends = [0]
    for _ in range(count):
        state = data[at : at + STATE.size_bytes]
        at += STATE.size_bytes
        runs = data[at - 1]  # the last field of the state
        if not runs:
            raise _InvalidError
        word = 2 * at
        for _ in range(runs):
            head = words[word]
            size = (head & _COUNT_MASK) + 1
            end = word + _WORD * (1 + size)
            from_ids += [at_reference[head >> COUNT_BITS]] * size
            ages_ms += words[word + _WORD : end : _WORD]
            word = end
        at = (word + 1) // 2
        if word % 2 and data[word // 2] & 0xF:  # padding
            raise _InvalidError
        states.append(state)
        ends.append(len(from_ids))
    if at != len(data):
        raise _InvalidError
    ids = list(map(sub, from_ids, ages_ms))
    provenances = [frozenset(ids[start:end]) for start, end in pairwise(ends)]
    if sum(map(len, provenances)) != len(ids):
        raise _InvalidError
    return b"".join(states), provenances


def _words(data: bytes) -> list[int]:
    """Return the 12 bits that begin at each half byte."""
    octets = np.frombuffer(data, np.uint8).astype(np.uint16)
    words = np.empty(2 * len(octets) - 2, np.uint16)
    words[0::2] = octets[:-1] << 4 | octets[1:] >> 4
    words[1::2] = (octets[:-1] & 0xF) << 8 | octets[1:]
    return words.tolist()
