"""Trace records of a run in readable form: names instead of IDs, sigmas instead of covariances."""

import math
import re
from collections.abc import Mapping
from typing import Any

from sim_rig.run_log.run_log import Record, RunLog

_ID = re.compile(r"\b[0-9a-f]{16}\b")
HIDDEN_KINDS = frozenset({"vehicle_detection", "detection_list", "position", "brake_pedal"})
"""Frequent kinds that the page does not show."""


class RunView:
    """Keeps the records of a running scenario."""

    def __init__(self, names: Mapping[str, str]) -> None:
        """`names` maps communication IDs (hex) to cars."""
        self._names = names
        self._traces: dict[str, list[Record]] = {}
        self._rig: list[Record] = []
        self.entries: list[dict[str, Any]] = []
        """Entries for the page, in the order of their arrival."""
        self.start_s: float | None = None
        """Stamp of the start of the scenario."""
        self.pages: Mapping[str, str] = {}
        """Addresses of the drivers' pages."""

    def receive_record(self, car: str, record: Record) -> None:
        """Add a record of a car's trace."""
        self._traces.setdefault(car, []).append(record)
        if record["kind"] not in HIDDEN_KINDS:
            shown = _perceived_object(record) if record["kind"] == "perceived_object" else record
            self.entries.append({"car": car} | self._readable(shown))

    def receive_rig(self, record: Record) -> None:
        """Add a record of the rig.

        `start` has the start time of the scenario, `pages` the addresses of the drivers' pages.
        """
        match record["kind"]:
            case "start":
                self.start_s = record["stamp_s"]
            case "pages":
                self.pages = record["pages"]
            case _:
                self._rig.append(record)

    def log(self) -> RunLog:
        """Return the run log up to now."""
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
    """Replace the covariance by one position sigma."""
    (east, *_), (_, north, *_), *_ = record["covariance"]
    shown = {key: value for key, value in record.items() if key != "covariance"}
    return shown | {
        "sigma_m": math.sqrt(max((east + north) / 2.0, 0.0)),
        "provenance": [list(measurement) for measurement in record["provenance"]],
    }
