"""The MVS footer: what a car knows of cars without a radio, behind the BSM it sends (section II-A).

Each part is declared once, below. The footer places everything relative to an anchor near the
sender and to one moment, so an entry is small: 12 bytes for a measurement, 21 for an estimate and
some 3 bytes for every two measurements in its provenance.

A covariance travels as standard deviations and partial correlations (of the Cholesky factor, row by
row): whatever bits arrive, they are a symmetric positive matrix. Standard deviations are rounded
up, never claiming more than is known.

On the wire: head, table of observers (4 bytes each), measurements, estimates each followed by its
provenance. In a provenance, measurements of an observer stand together, as an `ObserverRun` and an
age of 12 bits each; the last byte is filled up with zeros.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any

from typing_extensions import override

from onboard.errors import DecodeError
from onboard.messages.declaration import Layout, Number, Wire

VERSION = 2
OBSERVER_BYTES = 4
"""A BSM's temporary ID."""
LONGEST_AGE_MS = 4095
LONGEST_RUN = 16
_AGE_BITS, _RUN_BITS = 12, 12


@dataclass(frozen=True, slots=True)
class Sigma(Wire):
    """A standard deviation in steps of 1.2 %, from 1 cm to 1.9 km, rounded up."""

    bits: int = 10
    unit: str = "m"

    @override
    def to_raw(self, value: float) -> int:
        if not value > 0.0:
            raise ValueError(f"{value} is no standard deviation")
        steps = math.ceil(math.log(value / 0.01) / math.log(1.012) - 1e-6)
        return min(max(steps, 0), (1 << self.bits) - 1)

    @override
    def from_raw(self, raw: int) -> float:
        return float(0.01 * 1.012**raw)

    @override
    def row(self) -> tuple[str, str, str]:
        return self.unit, f"0.01 to {self.from_raw(1023):.0f} by 1.2 %", ""


_Count = Annotated[int, Wire(8)]
_Observer = Annotated[int, Wire(8)]
_Car = Annotated[int, Wire(8)]
"""The sender's own number for the car, the same in all its footers."""
_Offset = Annotated[float, Number(18, 0.01, "m", lowest=-131071, highest=131071)]
_Speed = Annotated[float, Number(14, 0.02, "m/s", lowest=-8191, highest=8191)]
_SigmaM = Annotated[float, Sigma()]
_SigmaMS = Annotated[float, Sigma(unit="m/s")]
_Correlation = Annotated[float, Number(8, 1 / 128, "", lowest=-127, highest=127)]


@dataclass(frozen=True, slots=True)
class FooterHeader:
    """Where, when and how much."""

    version: Annotated[int, Wire(8)]
    reference_ms: Annotated[int, Wire(48)]
    """UTC; ages count back from it."""
    latitude_deg: Annotated[
        float, Number(32, 1e-7, "deg", lowest=-900_000_000, highest=900_000_000)
    ]
    longitude_deg: Annotated[
        float, Number(32, 1e-7, "deg", lowest=-1_800_000_000, highest=1_800_000_000)
    ]
    observers: _Count
    measurements: _Count
    estimates: _Count


@dataclass(frozen=True, slots=True)
class SharedMeasurement:
    """`dm<v, t>` or `im<v, t>`: where a car was when one observer measured it."""

    observer: _Observer
    """Place in the table of observers."""
    car: _Car
    age_ms: Annotated[int, Wire(12)]
    reserved: Annotated[int, Wire(4)]
    east_m: _Offset
    north_m: _Offset
    sigma_east_m: _SigmaM
    sigma_north_m: _SigmaM
    correlation: _Correlation


@dataclass(frozen=True, slots=True)
class SharedState:
    """The state in `e<v, T>`, at the time of the last measurement in T."""

    car: _Car
    east_m: _Offset
    north_m: _Offset
    speed_east_m_s: _Speed
    speed_north_m_s: _Speed
    sigma_east_m: _SigmaM
    sigma_north_m: _SigmaM
    sigma_speed_east_m_s: _SigmaMS
    sigma_speed_north_m_s: _SigmaMS
    # Partial correlations, row by row below the diagonal.
    correlation_10: _Correlation
    correlation_20: _Correlation
    correlation_21: _Correlation
    correlation_30: _Correlation
    correlation_31: _Correlation
    correlation_32: _Correlation
    runs: _Count
    """Of the provenance that follows."""


@dataclass(frozen=True, slots=True)
class ObserverRun:
    """The measurements of one observer in a provenance."""

    observer: int
    """Place in the table of observers; 8 bits."""
    ages_ms: tuple[int, ...]
    """1 to 16 of them, all different; 4 bits say how many, less one."""


@dataclass(frozen=True, slots=True)
class SharedEstimate:
    """`e<v, T>`: a state and T."""

    state: SharedState
    provenance: tuple[ObserverRun, ...]


@dataclass(frozen=True, slots=True)
class MvsFooter:
    """What follows the BSM."""

    reference_ms: int
    latitude_deg: float
    longitude_deg: float
    observers: tuple[bytes, ...]
    measurements: tuple[SharedMeasurement, ...]
    estimates: tuple[SharedEstimate, ...]


@dataclass(frozen=True, slots=True)
class FooterParts:
    """A footer taken apart, its measurements and states not yet read."""

    head: FooterHeader
    observers: tuple[bytes, ...]
    measurements: bytes
    """Of all, one after the other."""
    states: bytes
    """Of all estimates, one after the other."""
    provenances: list[list[tuple[int, list[int]]]]
    """Of each estimate the runs: place in the table of observers, ages in ms."""


HEAD = Layout(FooterHeader)
MEASUREMENT = Layout(SharedMeasurement)
STATE = Layout(SharedState)


def encode(footer: MvsFooter) -> bytes:
    """Return the footer as it is sent.

    Raises:
        ValueError: a field holds what it cannot carry.
    """
    head = FooterHeader(
        VERSION,
        footer.reference_ms,
        footer.latitude_deg,
        footer.longitude_deg,
        len(footer.observers),
        len(footer.measurements),
        len(footer.estimates),
    )
    if any(len(observer) != OBSERVER_BYTES for observer in footer.observers):
        raise ValueError(f"an observer has {OBSERVER_BYTES} bytes: {footer.observers}")
    parts = [HEAD.encode(head), *footer.observers]
    parts += [MEASUREMENT.encode(measurement) for measurement in footer.measurements]
    for estimate in footer.estimates:
        if estimate.state.runs != len(estimate.provenance):
            raise ValueError(f"{len(estimate.provenance)} runs, declared {estimate.state.runs}")
        parts += [STATE.encode(estimate.state), _encode_provenance(estimate.provenance)]
    return b"".join(parts)


def decode(data: bytes) -> MvsFooter:
    """Read a footer from the air.

    Raises:
        DecodeError: those of `split`, `out_of_range`.
    """
    parts = split(data)
    head = parts.head
    states = _pieces(parts.states, STATE.size_bytes)
    return MvsFooter(
        head.reference_ms,
        head.latitude_deg,
        head.longitude_deg,
        parts.observers,
        tuple(
            MEASUREMENT.decode(measurement)
            for measurement in _pieces(parts.measurements, MEASUREMENT.size_bytes)
        ),
        tuple(
            SharedEstimate(
                STATE.decode(state),
                tuple(ObserverRun(observer, tuple(ages)) for observer, ages in runs),
            )
            for state, runs in zip(states, parts.provenances, strict=True)
        ),
    )


def split(data: bytes) -> FooterParts:
    """Find the parts of a footer from the air.

    Raises:
        DecodeError: `too_short`, `trailing_bytes`, `out_of_range`, `unknown_version`,
            `unknown_observer`, `empty_provenance` or `repeated_measurement`.
    """
    if data and data[0] != VERSION:
        raise DecodeError("unknown_version", f"{data[0]} instead of {VERSION}")
    reader = _Reader(data)
    head = HEAD.decode(reader.take(HEAD.size_bytes))
    observers = _pieces(reader.take(OBSERVER_BYTES * head.observers), OBSERVER_BYTES)
    measurements = reader.take(MEASUREMENT.size_bytes * head.measurements)
    states, provenances = [], []
    for _ in range(head.estimates):
        state = reader.take(STATE.size_bytes)
        states.append(state)
        provenances.append(_decode_provenance(reader, state[-1]))  # its last field counts the runs
    reader.finish()
    named = {observer for runs in provenances for observer, _ in runs}
    named.update(measurements[:: MEASUREMENT.size_bytes])  # their first field
    if named and max(named) >= head.observers:
        raise DecodeError("unknown_observer", f"number {max(named)} of {head.observers}")
    return FooterParts(head, tuple(observers), measurements, b"".join(states), provenances)


def _pieces(data: bytes, size: int) -> list[bytes]:
    return [data[at : at + size] for at in range(0, len(data), size)]


def as_dict(footer: MvsFooter) -> dict[str, Any]:
    """Return the footer as it stands in a trace line."""
    return {
        "reference_ms": footer.reference_ms,
        "latitude_deg": footer.latitude_deg,
        "longitude_deg": footer.longitude_deg,
        "observers": [observer.hex() for observer in footer.observers],
        "measurements": [MEASUREMENT.as_dict(m) for m in footer.measurements],
        "estimates": [
            STATE.as_dict(estimate.state)
            | {"provenance": {str(run.observer): run.ages_ms for run in estimate.provenance}}
            for estimate in footer.estimates
        ],
    }


def _encode_provenance(runs: tuple[ObserverRun, ...]) -> bytes:
    number, bits = 0, 0
    for run in runs:
        if not 1 <= len(run.ages_ms) <= LONGEST_RUN:
            raise ValueError(f"a run has 1 to {LONGEST_RUN} measurements, not {len(run.ages_ms)}")
        number = number << _RUN_BITS | Wire(8).to_raw(run.observer) << 4 | len(run.ages_ms) - 1
        for age_ms in run.ages_ms:
            number = number << _AGE_BITS | Wire(_AGE_BITS).to_raw(age_ms)
        bits += _RUN_BITS + _AGE_BITS * len(run.ages_ms)
    filling = -bits % 8
    return (number << filling).to_bytes((bits + filling) // 8)


def _decode_provenance(reader: "_Reader", count: int) -> list[tuple[int, list[int]]]:
    """Run heads and ages are words of 12 bits; each head says how many ages follow."""
    if not count:
        raise DecodeError("empty_provenance", "an estimate is made from something")
    words, ends = reader.take_runs(count)
    runs = [(words[at] >> 4, words[at + 1 : end]) for at, end in pairwise([0, *ends])]
    ages_ms = [age_ms for _, ages in runs for age_ms in ages]
    if len(set(ages_ms)) < len(ages_ms):  # seldom, since observers measure when they like
        named = {(observer, age_ms) for observer, ages in runs for age_ms in ages}
        if len(named) < len(ages_ms):
            raise DecodeError("repeated_measurement", "in the provenance of an estimate")
    return runs


class _Reader:
    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def take(self, size: int) -> bytes:
        start = self._at
        self._at += size
        if self._at > len(self._data):
            raise DecodeError("too_short", f"{len(self._data)} bytes are not all of it")
        return self._data[start : self._at]

    def take_runs(self, count: int) -> tuple[list[int], list[int]]:
        """The words of so many runs and where each run ends; the last byte is filled with zeros."""
        ahead = self._data[self._at : self._at + count * (LONGEST_RUN + 1) * 2]
        number, bits = int.from_bytes(ahead), len(ahead) * 8
        left, ends = bits, []
        for _ in range(count):
            left -= _RUN_BITS
            if left >= 0:
                left -= _AGE_BITS * ((number >> left & 15) + 1)
            if left < 0:
                raise DecodeError("too_short", f"{len(self._data)} bytes are not all of it")
            ends.append((bits - left) // _AGE_BITS)
        self._at += (bits - left + 7) // 8
        if number >> left // 8 * 8 & (1 << left % 8) - 1:
            raise DecodeError("out_of_range", "the filling bits are not zero")
        shifts = range(bits - _AGE_BITS, left - 1, -_AGE_BITS)
        return [number >> shift & LONGEST_AGE_MS for shift in shifts], ends

    def finish(self) -> None:
        rest = len(self._data) - self._at
        if rest:
            raise DecodeError("trailing_bytes", f"{rest} bytes behind the last entry")
