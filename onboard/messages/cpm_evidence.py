"""What MVS adds to the objects of a CPM: their uncertainty, and from which measurements they are.

Position, velocity, time and number of an object are in the CPM's own fields, which have the steps
of the MVS footer; bounds of 95 % without correlations of the velocity would not do for a fusion.
"""

from dataclasses import dataclass
from typing import Annotated

from onboard.messages.fields import Choice, Chosen, OctetString, SequenceOf, Unsigned
from onboard.messages.mvs_footer import (
    CORRELATION,
    MAX_OBSERVERS,
    OBSERVER_BITS,
    OBSERVER_BYTES,
    RUN,
    SIGMA_M,
    SIGMA_M_S,
    ObserverRun,
)
from onboard.messages.record import Record

VERSION = 1
MEASUREMENT, ESTIMATE = "measurement", "estimate"


@dataclass(frozen=True, slots=True)
class MeasurementEvidence:
    """Of an object that one observer measured once: its velocity is no part of that."""

    observer: Annotated[int, Unsigned(OBSERVER_BITS)]
    """Index in the table of observers."""
    sigma_east_m: Annotated[float, SIGMA_M]
    sigma_north_m: Annotated[float, SIGMA_M]
    correlation: Annotated[float, CORRELATION]


@dataclass(frozen=True, slots=True)
class EstimateEvidence:
    """Of an object that was fused."""

    sigma_east_m: Annotated[float, SIGMA_M]
    sigma_north_m: Annotated[float, SIGMA_M]
    sigma_speed_east_m_s: Annotated[float, SIGMA_M_S]
    sigma_speed_north_m_s: Annotated[float, SIGMA_M_S]
    # Partial correlations, row by row below the diagonal.
    correlation_10: Annotated[float, CORRELATION]
    correlation_20: Annotated[float, CORRELATION]
    correlation_21: Annotated[float, CORRELATION]
    correlation_30: Annotated[float, CORRELATION]
    correlation_31: Annotated[float, CORRELATION]
    correlation_32: Annotated[float, CORRELATION]
    runs: Annotated[tuple[ObserverRun, ...], SequenceOf(RUN, 1, 255)]
    """The provenance; ages count back from the message's reference time."""


@dataclass(frozen=True, slots=True)
class CpmEvidence:
    """The addition, with a piece for each object in its order."""

    version: Annotated[int, Unsigned(8)]
    observers: Annotated[
        tuple[bytes, ...], SequenceOf(OctetString(OBSERVER_BYTES), 0, MAX_OBSERVERS)
    ]
    pieces: Annotated[
        tuple[Chosen, ...],
        SequenceOf(
            Choice({MEASUREMENT: Record(MeasurementEvidence), ESTIMATE: Record(EstimateEvidence)}),
            0,
            255,
        ),
    ]


EVIDENCE = Record(CpmEvidence)
