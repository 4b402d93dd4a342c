"""Delay of a warning by loss, clocks and number of cars: `python -m tests.lcca.warning_delays`.

Cars `GAP_M` apart at 20 m/s, once their group is complete. The first one brakes, at a random moment
of a change of all IDs or without one. Written to docs/tables/warning-delays.csv.
"""

import csv
import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from onboard.lcca.events import WarningRaised
from tests.lcca.road import Air, Road, places, true_places

TABLE = Path(__file__).parents[2] / "docs" / "tables" / "warning-delays.csv"
RUNS = 200
GAP_M = 20.0
IN_TIME_S = 0.5


@dataclass(frozen=True)
class Row:
    """One line of the table; delays in ms, from the braking to the alarm."""

    cars: int
    reach_m: float
    loss: float
    clocks_apart_s: float | None
    """Largest difference of clocks at the change of IDs; `None` without a change."""
    runs: int
    due: int
    """Warnings that were due."""
    late: int
    """Not within `IN_TIME_S`."""
    median_ms: float
    p99_ms: float
    copies: float
    """Mean, of one state."""
    fewest_copies: int
    """On the shortest path, without loss."""


def row(cars: int, reach_m: float, loss: float, clocks_apart_s: float | None, runs: int) -> Row:
    """Simulate `runs` brakings."""
    delays_s: list[float] = []
    fewest = math.ceil((cars - 1) / (reach_m // GAP_M))
    copies: list[int] = []
    names = [f"{i:02d}" for i in range(cars)]
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        road = Road(Air(reach_m=reach_m, loss=loss, jitter_s=0.002), seed=seed)
        for i, name in enumerate(names):
            road.add(name, -GAP_M * i)
        road.run(6.0 + rng.uniform(0.0, 0.5))
        if places(road) != true_places(road):
            continue
        if clocks_apart_s is not None:
            road.change_ids(clocks_apart_s)
            road.run(rng.uniform(0.0, clocks_apart_s + 0.5))
        braked_at, before = road.now, len(road.warns())
        road.brake(names[0])
        road.run(0.95)
        copies.append(len(road.warns()) - before)
        for name in names[1:]:
            raised = [
                each.stamp_s for each in road.cars[name].said if isinstance(each, WarningRaised)
            ]
            delays_s.append(min(raised, default=np.inf) - braked_at)
    return Row(
        cars,
        reach_m,
        loss,
        clocks_apart_s,
        len(copies),
        len(delays_s),
        sum(each > IN_TIME_S for each in delays_s),
        round(1e3 * float(np.median(delays_s)), 1),
        round(1e3 * float(np.quantile(delays_s, 0.99)), 1),
        round(float(np.mean(copies)), 1),
        fewest,
    )


def main(runs: int = RUNS) -> None:
    """Write the table."""
    rows = []
    for cars, reach_m in ((8, 45.0), (24, 105.0)):
        for loss in (0.0, 0.1, 0.3):
            for clocks_apart_s in (None, 0.0, 2.0):
                rows.append(row(cars, reach_m, loss, clocks_apart_s, runs))
                sys.stderr.write(f"{rows[-1]}\n")
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(Row.__dataclass_fields__), lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            {name: getattr(each, name) for name in Row.__dataclass_fields__} for each in rows
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
