"""Reads trace files: ns-2 setdest, SUMO's floating car data, plain CSV, OpenACC; also as `.gz`.

Samples are resampled to the recording's interval. A file with gaps, jumps, one name for two cars or
decreasing times is refused with the place of the error.
"""

import csv
import gzip
import math
import re
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import IO
from xml.etree import ElementTree as ET

import numpy as np

from onboard.errors import UserError
from sim_rig.roads.cars import Array
from sim_rig.roads.openacc import FIRST_WORD, read_platoon
from sim_rig.roads.recording import STEP_S, RecordedTraffic, Trajectory

LENGTH_M, WIDTH_M = 4.5, 1.8
"""Default size of a car."""
FASTEST_M_S = 90.0
"""Faster motion is a jump."""
LONGEST_HOLE_S = 1.05
"""Longest interval between two samples of a car: traces have at least 1 Hz."""
LONGEST_S = 86_400.0
"""Longest trace, one day; longer ones have wrong times."""


class TraceError(UserError):
    """An error of a trace file, with its line or time."""


@dataclass(slots=True)
class _Samples:
    """Samples of one car, in order of time."""

    times_s: list[float] = field(default_factory=list)
    rows: list[tuple[float, float, float, float]] = field(default_factory=list)
    """x, y, heading, speed."""
    length_m: float = LENGTH_M
    width_m: float = WIDTH_M


def read_trace(path: Path) -> RecordedTraffic:
    """Read a trace; its suffix is `.ns2`, `.ns_movements`, `.tcl`, `.xml` or `.csv`.

    Raises:
        TraceError: the file cannot be read, or is not a valid trace.
    """
    endings = [ending for ending in path.suffixes if ending != ".gz"]
    reader = _READERS.get(endings[-1]) if endings else None
    if reader is None:
        raise TraceError(f"{path}: a trace ends in one of {', '.join(sorted(_READERS))} (.gz)")
    try:
        # Spreadsheets put a byte order mark before UTF-8.
        opened = gzip.open if path.suffix == ".gz" else open
        with opened(path, "rt", encoding="utf-8-sig") as file:
            return reader(file, str(path))
    except (OSError, EOFError, UnicodeDecodeError, csv.Error, zlib.error) as error:
        raise TraceError(f"{path}: cannot be read: {error}") from error


_NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
_SET = re.compile(rf"\$node_\((\w+)\) set ([XYZ])_ {_NUMBER}(?!\S)")
_SETDEST = re.compile(
    rf'\$ns_ at {_NUMBER} "\$node_\((\w+)\) setdest {_NUMBER} {_NUMBER} {_NUMBER}"'
)
_SWITCH = re.compile(rf'\$ns_ at {_NUMBER} "\$node_\((\w+)\) switch (ON|OFF)"')
_GOD = re.compile(rf'(\$ns_ at {_NUMBER} ")?\$god_ set-dist ')
"""Hop distances of nodes, which `setdest` writes too; not motion."""


@dataclass(slots=True)
class _Node:
    """One node of a setdest file: corners of its path, with the times at which it reaches them."""

    corners: list[tuple[float, float, float]] = field(default_factory=list)
    """(time, x, y)"""
    off_at_s: float = math.inf
    """Time at which it is switched off."""
    place: list[float | None] = field(default_factory=lambda: [None, None])
    """Initial x and y, as far as given."""
    has_left: bool = False
    """Whether it was placed elsewhere after driving."""

    @property
    def _last_command_s(self) -> float:
        """Time of the last `setdest`; a later corner is its destination."""
        return self.corners[-2 if len(self.corners) > 1 else -1][0]

    def go(self, at_s: float, x: float, y: float, speed_m_s: float) -> str | None:
        """Apply a `setdest`.

        Args:
            at_s: time of the command, s.
            x: destination, m.
            y: destination, m.
            speed_m_s: speed to the destination.

        Returns:
            The error of the command; `None` if it is valid.
        """
        if not self.corners:
            x0, y0 = self.place
            if x0 is None or y0 is None:
                return "moves before it has a place"
            self.corners.append((at_s, x0, y0))
        if at_s < self._last_command_s - 1e-9:
            return "has a command earlier than its last one"
        if speed_m_s > _PLACING_M_S:
            if len(self.corners) == 1:
                self.corners = [(at_s, x, y)]
            elif not self.has_left:
                self._be_at(at_s)
                self.has_left = True
            return None
        if self.has_left:
            return "jumps"
        if not 0.0 <= speed_m_s <= FASTEST_M_S:
            return f"drives at {speed_m_s:g} m/s"
        self._be_at(at_s)
        _, x0, y0 = self.corners[-1]
        if speed_m_s > 0.0 and (x, y) != (x0, y0):
            self.corners.append((at_s + math.hypot(x - x0, y - y0) / speed_m_s, x, y))
        return None

    def _be_at(self, at_s: float) -> None:
        """Cut an unfinished path at `at_s`, or wait until then."""
        time_s, x, y = self.corners[-1]
        if time_s > at_s:
            begin_s, x0, y0 = self.corners[-2]
            share = (at_s - begin_s) / (time_s - begin_s)
            self.corners[-1] = (at_s, x0 + share * (x - x0), y0 + share * (y - y0))
        elif at_s > time_s:
            self.corners.append((at_s, x, y))


_PLACING_M_S = 1e6
"""A `setdest` with a higher speed places the node: on the road, or off it at the end."""


def _read_setdest(lines: Iterable[str], origin: str) -> RecordedTraffic:
    """Read ns-2 setdest: positions of the middle. A car is present from its first to last move."""
    nodes: dict[str, _Node] = {}
    placed: set[tuple[str, str]] = set()
    for number, line in enumerate(lines, 1):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        if found := _SET.match(text):
            name, axis, value = found.groups()
            if (name, axis) in placed:
                raise TraceError(f"{origin}, line {number}: two cars are named {name}")
            placed.add((name, axis))
            if axis in "XY":
                nodes.setdefault(name, _Node()).place["XY".index(axis)] = float(value)
        elif found := _SETDEST.match(text):
            at_s, name, *numbers = found.groups()
            wrong = nodes.setdefault(name, _Node()).go(float(at_s), *map(float, numbers))
            if wrong is not None:
                raise TraceError(f"{origin}, line {number}: car {name} {wrong}")
        elif found := _SWITCH.match(text):
            at_s, name, state = found.groups()
            node = nodes.setdefault(name, _Node())
            if state == "OFF" and len(node.corners) > 1:
                node.off_at_s = min(node.off_at_s, float(at_s))
        elif not _GOD.match(text):
            raise TraceError(f"{origin}, line {number}: no command of setdest: {text[:60]!r}")
    drives = [_drive_along(name, node, origin) for name, node in nodes.items()]
    return _recording([drive for drive in drives if drive is not None], origin)


def _drive_along(name: str, node: _Node, origin: str) -> Trajectory | None:
    if len(node.corners) < 2:
        return None
    times_s, x, y = np.array(node.corners).T
    steps = _steps(np.minimum(times_s, node.off_at_s), name, origin)
    if len(steps) < 2:
        return None
    at_s = steps * STEP_S
    middle = np.stack([np.interp(at_s, times_s, x), np.interp(at_s, times_s, y)], axis=1)
    moved = np.diff(middle, axis=0)
    speed = np.hypot(*moved.T) / STEP_S
    heading = _held(np.arctan2(moved[:, 1], moved[:, 0]), speed > 0.01)
    return Trajectory(
        name,
        int(steps[0]),
        middle,
        np.unwrap(np.append(heading, heading[-1])),
        np.append(speed, speed[-1]),
        LENGTH_M,
        WIDTH_M,
    )


def _held(headings: Array, moving: Array) -> Array:
    """Keep the heading of standing cars; before the first motion, use that of the first."""
    if not moving.any():
        return np.zeros_like(headings)
    last = np.maximum.accumulate(np.where(moving, np.arange(len(headings)), -1))
    held: Array = headings[np.where(last < 0, int(moving.argmax()), last)]
    return held


def _read_fcd(file: IO[str], origin: str) -> RecordedTraffic:
    """Read SUMO's `--fcd-output`: angle, deg clockwise from north; position of the front bumper."""
    cars: dict[str, _Samples] = {}
    now_s = -math.inf
    try:
        for event, element in ET.iterparse(file, events=("start", "end")):  # noqa: S314 (the user's own file)
            if event == "start" and element.tag == "timestep":
                before_s, now_s = now_s, float(element.attrib["time"])
                if now_s <= before_s:
                    raise TraceError(f"{origin}: time {now_s:g} s comes after {before_s:g} s")
            elif event == "end" and element.tag == "vehicle":
                values = element.attrib
                row = (
                    float(values["x"]),
                    float(values["y"]),
                    math.radians(90.0 - float(values["angle"])),
                    float(values["speed"]),
                )
                _add_sample(cars, values["id"], now_s, row, origin)
            elif event == "end" and element.tag == "timestep":
                element.clear()
    except KeyError as error:
        raise TraceError(f"{origin}: not floating car data: no attribute {error}") from error
    except UnicodeDecodeError:
        raise  # as for every file
    except (ET.ParseError, ValueError) as error:
        raise TraceError(f"{origin}: not floating car data: {error}") from error
    return _recording(_drives(cars, origin), origin)


_COLUMNS = {"t": "t", "id": "id", "vin": "id", "x": "x", "y": "y", "heading": "heading"} | {
    "v": "v",
    "speed": "v",
    "length": "length",
    "width": "width",
}
_NEEDED = ("t", "id", "x", "v")
_OPTIONAL = ("y", "heading")
_ONCE_AROUND = 2.0 * math.pi + 1e-3


def _read_csv(file: IO[str], origin: str) -> RecordedTraffic:
    """Read CSV: t, id (or vin), x, y of the front bumper, heading, v (or speed); length, width.

    Without y and heading, all cars drive along one lane. A file of OpenACC is a CSV, too.
    """
    lines = iter(file)
    first = next(lines, "")
    if first.startswith(f"{FIRST_WORD},"):
        return _recording(read_platoon(chain([first], lines), origin), origin)
    rows = csv.DictReader(chain([first], lines))
    given = [name for name in rows.fieldnames or () if name in _COLUMNS]
    names = {_COLUMNS[name]: name for name in given}
    if len(given) > len(names):
        raise TraceError(f"{origin}: columns with the same meaning: {', '.join(given)}")
    missing = [name for name in _NEEDED if name not in names]
    if missing:
        raise TraceError(f"{origin}: no column {', '.join(missing)}")
    cars: dict[str, _Samples] = {}
    last_s = -math.inf
    for number, row in enumerate(rows, 2):
        if None in row.values() or None in row:
            raise TraceError(f"{origin}, line {number}: fields do not match columns")
        try:
            at_s, x, v = (float(row[names[key]]) for key in _NEEDED if key != "id")
            y, heading = (float(row[names[key]]) if key in names else 0.0 for key in _OPTIONAL)
            sizes = {key: float(row[names[key]]) for key in ("length", "width") if key in names}
        except ValueError as error:
            raise TraceError(f"{origin}, line {number}: {error}") from error
        if not all(0.0 < size < math.inf for size in sizes.values()):
            raise TraceError(f"{origin}, line {number}: length and width must be positive")
        if abs(heading) > _ONCE_AROUND:
            raise TraceError(f"{origin}, line {number}: a heading of {heading:g} rad (degrees?)")
        if at_s < last_s:
            raise TraceError(f"{origin}, line {number}: time {at_s:g} s comes after {last_s:g} s")
        last_s = at_s
        place = f"{origin}, line {number}"
        car = _add_sample(cars, row[names["id"]], at_s, (x, y, heading, v), place)
        car.length_m = sizes.get("length", car.length_m)
        car.width_m = sizes.get("width", car.width_m)
    return _recording(_drives(cars, origin), origin)


def _add_sample(
    cars: dict[str, _Samples], name: str, at_s: float, row: tuple[float, float, float, float],
    origin: str,
) -> _Samples:  # fmt: skip
    if not name:
        raise TraceError(f"{origin}: a car without a name")
    if not all(map(math.isfinite, (at_s, *row))):
        raise TraceError(f"{origin}: car {name} has no finite state at {at_s:g} s")
    if not 0.0 <= row[3] <= FASTEST_M_S:
        raise TraceError(f"{origin}: car {name} drives at {row[3]:g} m/s")
    car = cars.setdefault(name, _Samples())
    if car.times_s:
        passed_s = at_s - car.times_s[-1]
        if passed_s <= 0.0:
            raise TraceError(f"{origin}: two cars are named {name} at {at_s:g} s")
        if passed_s > LONGEST_HOLE_S:
            raise TraceError(
                f"{origin}: car {name} is missing from {car.times_s[-1]:g} s to {at_s:g} s"
            )
        moved_m = math.dist(row[:2], car.rows[-1][:2])
        if moved_m > FASTEST_M_S * passed_s:
            raise TraceError(f"{origin}: car {name} jumps {moved_m:.0f} m at {at_s:g} s")
    car.times_s.append(at_s)
    car.rows.append(row)
    return car


def _drives(cars: dict[str, _Samples], origin: str) -> Iterator[Trajectory]:
    begin_s = min((car.times_s[0] for car in cars.values()), default=0.0)
    for name, car in cars.items():
        times_s = np.array(car.times_s) - begin_s
        steps = _steps(times_s, name, origin)
        if len(steps) < 2:
            continue
        x, y, heading, v = np.array(car.rows).T
        heading = np.unwrap(heading)
        at_s = steps * STEP_S
        angle, speed = np.interp(at_s, times_s, heading), np.interp(at_s, times_s, v)
        front = np.stack([np.interp(at_s, times_s, x), np.interp(at_s, times_s, y)], axis=1)
        middle = front - car.length_m / 2 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        yield Trajectory(name, int(steps[0]), middle, angle, speed, car.length_m, car.width_m)


def _steps(times_s: Array, name: str, origin: str) -> Array:
    if times_s[-1] > LONGEST_S:
        raise TraceError(f"{origin}: car {name} drives until {times_s[-1]:g} s: more than a day")
    first, last = math.ceil(times_s[0] / STEP_S - 1e-6), math.floor(times_s[-1] / STEP_S + 1e-6)
    return np.arange(first, last + 1)


def _recording(drives: Iterable[Trajectory], origin: str) -> RecordedTraffic:
    found = list(drives)
    if not found:
        raise TraceError(f"{origin}: no car drives")
    return RecordedTraffic(found)


_READERS: dict[str, Callable[[IO[str], str], RecordedTraffic]] = {
    ".ns2": _read_setdest,
    ".ns_movements": _read_setdest,
    ".tcl": _read_setdest,
    ".xml": _read_fcd,
    ".csv": _read_csv,
}
