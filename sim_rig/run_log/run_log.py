"""Traces of one run. Live and virtual runs have the same form."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from sim_rig.run_log.clock_offset import ClockOffset
from sim_rig.run_log.lateness import LatenessLine

Record = Mapping[str, Any]
"""One line of a trace: `stamp_s`, `kind`, and the fields of that kind."""


@dataclass(frozen=True)
class RunLog:
    """The traces of one run on one clock."""

    start_s: float
    """Stamp of the start of the scenario."""
    traces: Mapping[str, Sequence[Record]]
    """Trace of each equipped car, in order of time."""
    rig: Sequence[Record]
    """Records of the rig: `ecu_answer`, `on_air`, `delivered`, `car_state`."""
    names: Mapping[str, str]
    """Car of each communication ID (hex); a car has several when an epoch ends in the run."""
    clocks: Mapping[str, Sequence[ClockOffset]] = field(default_factory=dict)
    """Offset of the clock of each box, which its trace has been mapped with; one for each start."""
    unjudged: Mapping[str, str] = field(default_factory=dict)
    """Why the trace of a box cannot be judged."""
    by_messages: frozenset[str] = frozenset()
    """Boxes without a recording, whose traces have only the messages that they sent."""
    notes: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """What of a box is not as in a process of its car."""
    builds: Mapping[str, str] = field(default_factory=dict)
    """Build of `onboard` of each box, from its recording."""
    lateness: Sequence[LatenessLine] = ()
    """How late the rig was."""
    daemon_lateness: Sequence[LatenessLine] = ()
    """How late the daemons were that are processes of the rig's computer."""

    def shifted(self, car: str, by_s: float) -> "RunLog":
        """Return the log with all stamps of the trace of `car` moved by `by_s`."""
        moved = [{**each, "stamp_s": each["stamp_s"] + by_s} for each in self.traces[car]]
        return replace(self, traces={**self.traces, car: moved})

    def at_s(self, record: Record) -> float:
        """Time of a record since the start of the scenario, s."""
        return float(record["stamp_s"]) - self.start_s

    def of(
        self, car: str, kind: str, from_s: float = -1e9, until_s: float = 1e9, **fields: object
    ) -> Iterator[Record]:
        """Yield the records of one car that match.

        Args:
            car: name of the car.
            kind: kind of the records.
            from_s: start of the interval since the start of the scenario, s.
            until_s: end of the interval, s.
            fields: values that the records' fields must have.
        """
        for record in self.traces[car]:
            if (
                record["kind"] == kind
                and from_s <= self.at_s(record) <= until_s
                and all(record.get(name) == value for name, value in fields.items())
            ):
                yield record

    def brakings(self, car: str, until_s: float = 1e9) -> Iterator[Record]:
        """Yield the record that begins each hard braking of a car, without those that change it.

        Args:
            car: name of the car.
            until_s: end of the interval since the start of the scenario, s.
        """
        is_braking = False
        for record in self.of(car, "hard_brake", until_s=until_s):
            if not is_braking:
                yield record
            is_braking = not record.get("is_over", False)

    def name(self, car_id: str) -> str:
        """Car of a communication ID (hex); the ID itself if it is unknown."""
        return self.names.get(car_id, car_id)

    def write(self, folder: Path) -> None:
        """Write each trace as `<car>.jsonl`, and the rig's as `rig.jsonl`."""
        folder.mkdir(parents=True, exist_ok=True)
        for car, records in {**self.traces, "rig": self.rig}.items():
            lines = "".join(f"{json.dumps(record, separators=(',', ':'))}\n" for record in records)
            (folder / f"{car}.jsonl").write_text(lines, encoding="utf-8")


def read_trace(path: Path) -> list[Record]:
    """Read a trace. An incomplete last line is left out.

    Raises:
        OSError: it cannot be read.
        ValueError: a line is no JSON object.
    """
    records, _ = parse_trace(path.read_bytes())
    return records


def parse_trace(data: bytes) -> tuple[list[Record], int]:
    """Return the records of the complete lines, and how many bytes these have.

    Raises:
        ValueError: a line is no JSON object.
    """
    complete = data[: data.rfind(b"\n") + 1]
    records = [json.loads(line) for line in complete.splitlines()]
    if not all(isinstance(record, dict) for record in records):
        raise ValueError("a line is no JSON object")
    return records, len(complete)
