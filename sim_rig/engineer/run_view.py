"""What the traces of a run tell, in a form for people: names in the place of IDs, no matrices."""

import math
import re
from collections.abc import Mapping
from typing import Any

from sim_rig.run_log.run_log import Record, RunLog

_ID = re.compile(r"\b[0-9a-f]{16}\b")
UNTOLD = frozenset({"vehicle_detection", "detection_list", "position", "brake_pedal"})
"""Kinds that come often and that no view of the page shows."""


class RunView:
    """Takes the records as they come, and keeps them."""

    def __init__(self, names: Mapping[str, str]) -> None:
        """`names`: which car sends under an ID (hex)."""
        self._names = names
        self._traces: dict[str, list[Record]] = {}
        self._rig: list[Record] = []
        self.entries: list[dict[str, Any]] = []
        """For the page, in the order in which they came to be known."""
        self.start_s: float | None = None
        """The stamp at which the scenario began."""
        self.pages: Mapping[str, str] = {}
        """Addresses of the drivers' pages."""

    def receive(self, car: str, record: Record) -> None:
        """A line of a car's trace."""
        self._traces.setdefault(car, []).append(record)
        if record["kind"] not in UNTOLD:
            told = _perceived_object(record) if record["kind"] == "perceived_object" else record
            self.entries.append({"car": car} | self._readable(told))

    def receive_rig(self, record: Record) -> None:
        """A line of the rig's own.

        `start` says when the scenario began, `pages` where the drivers' pages are.
        """
        match record["kind"]:
            case "start":
                self.start_s = record["stamp_s"]
            case "pages":
                self.pages = record["pages"]
            case _:
                self._rig.append(record)

    def log(self) -> RunLog:
        """The run as far as it is known."""
        start_s = math.inf if self.start_s is None else self.start_s
        return RunLog(start_s, self._traces, self._rig, self._names)

    def _readable(self, value: Any) -> Any:
        if isinstance(value, str):
            return _ID.sub(lambda found: self._names.get(found[0], found[0]), value)
        if isinstance(value, Mapping):
            return {key: self._readable(item) for key, item in value.items()}
        if isinstance(value, list):
            return [self._readable(item) for item in value]
        return value


def _perceived_object(record: Record) -> Record:
    """One standard deviation in the place of the covariance; the measurements by their observer."""
    (east, *_), (_, north, *_), *_ = record["covariance"]
    told = {key: value for key, value in record.items() if key != "covariance"}
    return told | {
        "sigma_m": math.sqrt(max((east + north) / 2.0, 0.0)),
        "provenance": [list(measurement) for measurement in record["provenance"]],
    }
