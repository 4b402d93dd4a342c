"""The MVS footer: what a car shares of other vehicles, behind the BSM it sends (section II-A).

Each part is declared once, below. Positions are relative to an anchor near the sender and times to
one moment, so an entry is small: 12 bytes for a measurement, 21 for an estimate and some 3 bytes
for every two measurements in its provenance.

A covariance is sent as standard deviations and partial correlations (of the Cholesky factor, row by
row), which give a symmetric positive matrix whatever bits arrive. Standard deviations are rounded
up, so that the receiver never takes an entry for more accurate than it is.

On the wire: header, table of observers (4 bytes each), measurements, estimates each followed by its
provenance. A provenance lists its measurements by observer, as `ObserverRun`s; its last byte is
padded with zeros.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Any

from typing_extensions import override

from onboard.errors import DecodeError
from onboard.messages.bit_io import BitReader, BitWriter
from onboard.messages.fields import FixedField, FixedPoint, SequenceOf, Unsigned
from onboard.messages.record import Record

VERSION = 2
OBSERVER_BYTES = 4
"""Size of a BSM's temporary ID."""
MAX_OBSERVERS = 255
"""In one message: an observer is named by one byte."""
AGE_BITS = 12
COUNT_BITS = 4
"""Width of the number of measurements in a run, less one."""
OBSERVER_BITS = AGE_BITS - COUNT_BITS
"""Observer and count have together as many bits as an age: a provenance is a series of words."""
MAX_AGE_MS = (1 << AGE_BITS) - 1
MAX_RUN = 1 << COUNT_BITS


class StandardDeviation(FixedField):
    """A standard deviation in steps of 1.2 %, from 1 cm to 1.9 km, rounded up."""

    def __init__(self, unit: str) -> None:
        self.bits = 10
        self.unit = unit

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


_Count = Annotated[int, Unsigned(8)]
_Observer = Annotated[int, Unsigned(OBSERVER_BITS)]
"""Index in the table of observers."""
_Car = Annotated[int, Unsigned(8)]
"""The sender's own number for the vehicle, the same in all its footers."""
_Offset = Annotated[float, FixedPoint(18, 0.01, "m", lowest=-131071, highest=131071)]
_Speed = Annotated[float, FixedPoint(14, 0.02, "m/s", lowest=-8191, highest=8191)]
SIGMA_M, SIGMA_M_S = StandardDeviation("m"), StandardDeviation("m/s")
CORRELATION = FixedPoint(8, 1 / 128, "", lowest=-127, highest=127)
_SigmaM = Annotated[float, SIGMA_M]
_SigmaMS = Annotated[float, SIGMA_M_S]
_Correlation = Annotated[float, CORRELATION]


@dataclass(frozen=True, slots=True)
class FooterHeader:
    """Reference position and time, and the numbers of entries."""

    version: Annotated[int, Unsigned(8)]
    reference_ms: Annotated[int, Unsigned(48)]
    """UTC from which ages count back."""
    latitude_deg: Annotated[
        float, FixedPoint(32, 1e-7, "deg", lowest=-900_000_000, highest=900_000_000)
    ]
    longitude_deg: Annotated[
        float, FixedPoint(32, 1e-7, "deg", lowest=-1_800_000_000, highest=1_800_000_000)
    ]
    observers: _Count
    measurements: _Count
    estimates: _Count


@dataclass(frozen=True, slots=True)
class SharedMeasurement:
    """`dm<v, t>` or `im<v, t>`: the position of a vehicle when one observer measured it."""

    observer: _Observer
    car: _Car
    age_ms: Annotated[int, Unsigned(AGE_BITS)]
    reserved: Annotated[int, Unsigned(4)]
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
    """Number of runs in the provenance that follows."""


@dataclass(frozen=True, slots=True)
class ObserverRun:
    """Measurements of one observer in a provenance."""

    observer: _Observer
    ages_ms: Annotated[tuple[int, ...], SequenceOf(Unsigned(AGE_BITS), 1, MAX_RUN)]
    """All different."""


@dataclass(frozen=True, slots=True)
class SharedEstimate:
    """`e<v, T>`: a state and T."""

    state: SharedState
    provenance: tuple[ObserverRun, ...]


@dataclass(frozen=True, slots=True)
class MvsFooter:
    """A whole footer."""

    reference_ms: int
    latitude_deg: float
    longitude_deg: float
    observers: tuple[bytes, ...]
    measurements: tuple[SharedMeasurement, ...]
    estimates: tuple[SharedEstimate, ...]


HEADER = Record(FooterHeader)
MEASUREMENT = Record(SharedMeasurement)
STATE = Record(SharedState)
RUN = Record(ObserverRun)


def encode(footer: MvsFooter) -> bytes:
    """Return the footer as it is sent.

    Raises:
        ValueError: a field cannot carry its value.
    """
    header = FooterHeader(
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
    parts = [HEADER.encode(header), *footer.observers]
    parts += [MEASUREMENT.encode(measurement) for measurement in footer.measurements]
    for estimate in footer.estimates:
        if estimate.state.runs != len(estimate.provenance):
            raise ValueError(f"{len(estimate.provenance)} runs, declared {estimate.state.runs}")
        parts += [STATE.encode(estimate.state), _encode_provenance(estimate.provenance)]
    return b"".join(parts)


def size_of_estimate(measurements: Iterable[int]) -> int:
    """Return the bytes of an estimate by the number of measurements of each observer."""
    words = sum(count + math.ceil(count / MAX_RUN) for count in measurements)
    return STATE.size_bytes + math.ceil(words * AGE_BITS / 8)


def decode(data: bytes) -> MvsFooter:
    """Read a received footer.

    Raises:
        DecodeError: `too_short`, `trailing_bytes`, `out_of_range`, `unknown_version`,
            `unknown_observer`, `empty_provenance` or `repeated_measurement`.
    """
    if data and data[0] != VERSION:
        raise DecodeError("unknown_version", f"{data[0]} instead of {VERSION}")
    reader = BitReader(data)
    header = HEADER.take(reader)
    if header.reference_ms < MAX_AGE_MS:
        raise DecodeError("out_of_range", f"{header.reference_ms} ms since 1970")
    observers = tuple(
        reader.take(OBSERVER_BYTES * 8).to_bytes(OBSERVER_BYTES) for _ in range(header.observers)
    )
    measurements = tuple(MEASUREMENT.take(reader) for _ in range(header.measurements))
    estimates = tuple(_take_estimate(reader) for _ in range(header.estimates))
    if reader.left:
        raise DecodeError("trailing_bytes", f"{reader.left // 8} bytes behind the last entry")
    named = {each.observer for each in measurements}
    named.update(run.observer for estimate in estimates for run in estimate.provenance)
    if named and max(named) >= header.observers:
        raise DecodeError("unknown_observer", f"number {max(named)} of {header.observers}")
    return MvsFooter(
        header.reference_ms,
        header.latitude_deg,
        header.longitude_deg,
        observers,
        measurements,
        estimates,
    )


def _take_estimate(reader: BitReader) -> SharedEstimate:
    state = STATE.take(reader)
    if not state.runs:
        raise DecodeError("empty_provenance", "an estimate is made from something")
    runs = tuple(RUN.take(reader) for _ in range(state.runs))
    if reader.take(reader.left % 8):
        raise DecodeError("out_of_range", "the padding bits are not zero")
    measurements = [(run.observer, age_ms) for run in runs for age_ms in run.ages_ms]
    if len(set(measurements)) < len(measurements):
        raise DecodeError("repeated_measurement", "in the provenance of an estimate")
    return SharedEstimate(state, runs)


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
    if not runs:
        return b""
    writer = BitWriter()
    for run in runs:
        RUN.put(writer, run)
    return writer.finish()
