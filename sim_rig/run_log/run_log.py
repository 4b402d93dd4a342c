"""What happened in a run, as the traces of its cars tell it. Live and virtual runs look alike."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Record = Mapping[str, Any]
"""One line of a trace: `stamp_s`, `kind`, and the fields of that kind."""


@dataclass(frozen=True)
class RunLog:
    """The traces of one run on one clock."""

    start_s: float
    """The stamp at which the scenario began."""
    traces: Mapping[str, Sequence[Record]]
    """Of each equipped car, in order of time."""
    rig: Sequence[Record]
    """What the rig did at its ends of the wires: `ecu_answer`, `on_air`."""
    names: Mapping[str, str]
    """Which car has sent under an ID (hex); a car has several when an epoch ends in the run."""

    def at_s(self, record: Record) -> float:
        """When it happened, in seconds since the scenario began."""
        return float(record["stamp_s"]) - self.start_s

    def of(
        self, car: str, kind: str, from_s: float = -1e9, until_s: float = 1e9, **fields: object
    ) -> Iterator[Record]:
        """The records of one kind of one car, within a time, whose fields have these values."""
        for record in self.traces[car]:
            if (
                record["kind"] == kind
                and from_s <= self.at_s(record) <= until_s
                and all(record.get(name) == value for name, value in fields.items())
            ):
                yield record

    def name(self, car_id: str) -> str:
        """The car that has sent under this ID (hex); the ID itself if nobody has."""
        return self.names.get(car_id, car_id)

    def write(self, folder: Path) -> None:
        """Write each trace as `<car>.jsonl`, and the rig's as `rig.jsonl`."""
        folder.mkdir(parents=True, exist_ok=True)
        for car, records in {**self.traces, "rig": self.rig}.items():
            lines = "".join(f"{json.dumps(record, separators=(',', ':'))}\n" for record in records)
            (folder / f"{car}.jsonl").write_text(lines, encoding="utf-8")


def read_trace(path: Path) -> list[Record]:
    """Read a trace back. A last line that was cut off while being written is left out."""
    text = path.read_text(encoding="utf-8")
    return [json.loads(line) for line in text[: text.rfind("\n") + 1].splitlines()]
