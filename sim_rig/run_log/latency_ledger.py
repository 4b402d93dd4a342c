"""The latency ledger: delay of each step from the braking on the CAN bus to the alarm.

All processes of a run share one machine, and so one clock. The steps:

    noticed    first speed sample of the braking -> the sample that confirms it
    detected   that sample leaves the ECU -> the daemon reads it from the bus
    sent       read from the bus -> warning passed to the radio
    received   passed to the radio -> read from the radio by the next car, for each hop
    alarm      read from the radio -> alarm raised
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sim_rig.run_log.run_log import Record, RunLog

HOPS = ("noticed", "detected", "sent", "received", "alarm")
_BRAKING_LASTS_S = 5.0


@dataclass(frozen=True, slots=True)
class Line:
    """Delays of one step."""

    hop: str
    n: int
    p50_s: float
    p99_s: float


def ledger(log: RunLog) -> list[Line]:
    """Return a line for each step that occurred.

    The last line, `chain`, is the total from the confirmed braking to the alarm in another car.
    """
    delays_s: dict[str, list[float]] = {hop: [] for hop in (*HOPS, "chain")}
    for car in log.traces:
        for brake in log.brakings(car):
            for hop, delay_s in _in_braking_car(log, car, brake):
                delays_s[hop].append(delay_s)
        for warning in log.of(car, "warning"):
            for hop, delay_s in _in_warned_car(log, car, warning):
                delays_s[hop].append(delay_s)
    return [_line(hop, found) for hop, found in delays_s.items() if found]


def _line(hop: str, delays_s: Sequence[float]) -> Line:
    p50, p99 = np.percentile(delays_s, [50, 99])
    return Line(hop, len(delays_s), float(p50), float(p99))


def _in_braking_car(log: RunLog, car: str, brake: Record) -> Iterator[tuple[str, float]]:
    answers = [
        record
        for record in log.rig
        if record["kind"] == "ecu_answer"
        and record["car"] == car
        and brake["stamp_s"] - _BRAKING_LASTS_S < record["stamp_s"] <= brake["stamp_s"]
    ]
    if answers:
        yield "noticed", answers[-1]["stamp_s"] - _first_lower(answers)["stamp_s"]
        yield "detected", brake["stamp_s"] - answers[-1]["stamp_s"]
    for sent in log.of(car, "sent", message="warn"):
        if 0 <= sent["stamp_s"] - brake["stamp_s"] < 1.0 and sent["content"]["hops"] == 1:
            yield "sent", sent["stamp_s"] - brake["stamp_s"]
            return


def _first_lower(answers: Sequence[Record]) -> Record:
    """The first sample of the speed drop that the last one belongs to."""
    first = answers[-1]
    for sooner, later in pairwise(reversed(answers)):
        if later["speed_km_h"] < sooner["speed_km_h"]:
            break
        if later["speed_km_h"] > sooner["speed_km_h"]:
            first = sooner
    return first


def _in_warned_car(log: RunLog, car: str, warning: Record) -> Iterator[tuple[str, float]]:
    event = (warning["origin_id"], warning["sequence"])
    received = _last(log.of(car, "received", until_s=log.at_s(warning), message="warn"), event)
    if received is None:
        return
    yield "alarm", alarm_stamp_s(warning) - received["stamp_s"]
    sender = log.name(received["content"]["sender_id"])
    if sender in log.traces:
        sent = _last(log.of(sender, "sent", until_s=log.at_s(received), message="warn"), event)
        if sent is not None:
            yield "received", received["stamp_s"] - sent["stamp_s"]
    brake = braking_of(log, warning)
    if brake is not None:
        yield "chain", alarm_stamp_s(warning) - brake["stamp_s"]


def alarm_stamp_s(warning: Record) -> float:
    """Stamp of the alarm: the time of its display, if the trace has it."""
    return float(warning.get("traced_s", warning["stamp_s"]))


def braking_of(log: RunLog, warning: Record) -> Record | None:
    """The hard braking that a warning is about: the last one of its origin before it."""
    origin = log.name(warning["origin_id"])
    if origin not in log.traces:
        return None
    brakes = list(log.brakings(origin, log.at_s(warning)))
    return brakes[-1] if brakes else None


def _last(records: Iterator[Record], event: tuple[str, int]) -> Record | None:
    """The last record about the warning `event`."""
    last = None
    for record in records:
        if event_of(record["content"]) == event:
            last = record
    return last


def event_of(content: Mapping[str, object]) -> tuple[object, object]:
    """Key of the event that a warn or update message is about."""
    return content["event_origin_id"], content["event_sequence"]
