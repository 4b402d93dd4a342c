"""Reads recorded platoons in the format of JRC's OpenACC, as motion along one straight lane.

Five lines of head, then a table: `Time`, for each car `Speed<n>` among its positions, and the
spacings `IVS<n>` between car n and the one behind it. The first car drives as far as its speed
says, each other car is its recorded spacing behind, or, where cars between them were not recorded,
as far behind as its position `E<n>`, `N<n>` says; and speeds are as recorded, since a bend of the
test track is not a bend of the lane. A value that is missing is interpolated.
"""

import csv
import re
from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np

from onboard.errors import UserError
from sim_rig.roads.cars import Array
from sim_rig.roads.recording import STEP_S, Trajectory

HEAD_LINES = 5
FIRST_WORD = "Date"
"""First word of such a file."""
_COLUMN = re.compile(r"Time|(Speed|IVS|E|N)\d+")
LENGTH_M, WIDTH_M = 4.5, 1.8
"""Size of the cars, which the recordings do not tell."""


def read_platoon(lines: Iterator[str], origin: str) -> Iterator[Trajectory]:
    """Yield the cars `car1`, `car2`, ..., the first one ahead; some numbers may be missing.

    Args:
        lines: of the file.
        origin: its name, for errors.

    Raises:
        UserError: a column is missing, or a field is no number.
    """
    for _ in range(HEAD_LINES):
        next(lines, "")
    columns = _columns(lines, origin)
    if "Time" not in columns:
        raise UserError(f"{origin}: no column Time")
    times_s = columns["Time"] - columns["Time"][0]
    at_s: Array = np.arange(int(times_s[-1] / STEP_S + 1e-6) + 1, dtype=np.float64) * STEP_S
    numbers = sorted(int(name[5:]) for name in columns if name.startswith("Speed"))
    speeds = {n: _sampled(f"Speed{n}", columns, times_s, at_s, origin) for n in numbers}
    fronts_m: dict[int, Array] = {}
    if numbers:
        speed = speeds[numbers[0]]
        driven_m = np.cumsum((speed[1:] + speed[:-1]) / 2 * STEP_S)
        fronts_m[numbers[0]] = np.concatenate([[0.0], driven_m])
    for ahead, number in pairwise(numbers):
        names = [f"IVS{ahead}"]
        if number > ahead + 1:
            names = [f"{axis}{n}" for axis in "EN" for n in (ahead, number)]
        found = [_sampled(name, columns, times_s, at_s, origin) for name in names]
        fronts_m[number] = fronts_m[ahead] - LENGTH_M - _spacing_m(found)
    for number, front_m in fronts_m.items():
        middle = np.stack([front_m - LENGTH_M / 2, np.zeros(len(at_s))], axis=1)
        yield Trajectory(
            f"car{number}", 0, middle, np.zeros(len(at_s)), speeds[number], LENGTH_M, WIDTH_M
        )


def _spacing_m(found: list[Array]) -> Array:
    """The recorded spacing, or that between two positions: east of both, north of both."""
    if len(found) == 1:
        return found[0]
    east_m, east_behind_m, north_m, north_behind_m = found
    spacing_m: Array = np.hypot(east_m - east_behind_m, north_m - north_behind_m) - LENGTH_M
    return spacing_m


def _columns(lines: Iterator[str], origin: str) -> dict[str, Array]:
    """The needed columns, with NaN where a field is empty."""
    rows = csv.DictReader(lines)
    fields = [name for name in rows.fieldnames or () if _COLUMN.fullmatch(name)]
    table: list[list[float]] = []
    for number, row in enumerate(rows, HEAD_LINES + 2):
        try:
            table.append([float(row[name] or "nan") for name in fields])
        except (TypeError, ValueError) as error:
            raise UserError(f"{origin}, line {number}: {error}") from error
    if len(table) < 2:
        raise UserError(f"{origin}: a platoon takes two rows at least")
    return dict(zip(fields, np.array(table).T, strict=True))


def _sampled(
    name: str, columns: Mapping[str, Array], times_s: Array, at_s: Array, origin: str
) -> Array:
    if name not in columns:
        raise UserError(f"{origin}: no column {name}")
    known = ~np.isnan(columns[name])
    if not known.any():
        raise UserError(f"{origin}: the column {name} is empty")
    sampled: Array = np.interp(at_s, times_s[known], columns[name][known])
    return sampled
