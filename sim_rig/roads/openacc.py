"""Reads recorded platoons in the format of JRC's OpenACC, as motion along one straight lane.

Five lines of head, then a table: `Time`, for each car `Speed<n>` among its positions, and the
spacings `IVS<n>` between car n and the one behind it. The first car drives as far as its speed
says, each other car is its recorded spacing behind, and speeds are as recorded, since a bend of the
test track is not a bend of the lane. A value that is missing is interpolated.
"""

import csv
from collections.abc import Iterator, Mapping
from itertools import count

import numpy as np

from onboard.errors import UserError
from sim_rig.roads.cars import Array
from sim_rig.roads.recording import STEP_S, Trajectory

HEAD_LINES = 5
FIRST_WORD = "Date"
"""First word of such a file."""
LENGTH_M, WIDTH_M = 4.5, 1.8
"""Size of the cars, which the recordings do not tell."""


def read_platoon(lines: Iterator[str], origin: str) -> Iterator[Trajectory]:
    """Yield the cars `car1`, `car2`, ..., the first one ahead.

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
    front_m: Array = np.zeros(len(at_s))
    for number in count(1):
        if f"Speed{number}" not in columns:
            break
        speed = _sampled(f"Speed{number}", columns, times_s, at_s, origin)
        if number == 1:
            front_m = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * STEP_S)])
        else:
            front_m = (
                front_m - LENGTH_M - _sampled(f"IVS{number - 1}", columns, times_s, at_s, origin)
            )
        middle = np.stack([front_m - LENGTH_M / 2, np.zeros(len(at_s))], axis=1)
        yield Trajectory(f"car{number}", 0, middle, np.zeros(len(at_s)), speed, LENGTH_M, WIDTH_M)


def _columns(lines: Iterator[str], origin: str) -> dict[str, Array]:
    """The needed columns, with NaN where a field is empty."""
    rows = csv.DictReader(lines)
    fields = [name for name in rows.fieldnames or () if name.startswith(("Time", "Speed", "IVS"))]
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
