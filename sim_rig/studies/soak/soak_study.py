"""Load and endurance: a daemon in background traffic, many daemons, an hour of changing traffic."""

import asyncio
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field

from onboard.settings import Settings
from sim_rig.studies.campaigns.study import Case, Results, Study
from sim_rig.studies.soak.fleet import Fleet, resident_bytes
from sim_rig.studies.soak.load import load
from sim_rig.studies.soak.testbench import run_daemons

TESTBENCH_S = 30.0
Quantities = list[tuple[str, float, str]]
"""Each with its value and unit."""


class SoakSettings(Settings):
    """One run of the study."""

    load_s: float = Field(20.0, ge=0.0, le=600.0)
    """Duration of the background traffic, after as long without it but at most a minute; 0 skips
    this part."""
    rate_hz: float = Field(3000.0, gt=0.0, le=20_000.0)
    """Datagrams a second."""
    testbench_cars: int = Field(20, ge=0, le=100)
    """Daemons that run at the same time, for half a minute; 0 skips this part."""
    fleet_s: float = Field(3600.0, ge=0.0, le=36_000.0)
    """Virtual time that the fleet drives; 0 skips this part."""


def about_s(settings: SoakSettings) -> float:
    """How long all parts take together; virtual time is ten times as fast as real time."""
    testbench_s = 40.0 if settings.testbench_cars else 0.0
    return 2.0 * settings.load_s + testbench_s + settings.fleet_s / 10.0


@dataclass(frozen=True, slots=True)
class QuantityLine:
    """One line of the table."""

    quantity: str
    value: float
    unit: str


def run(settings: SoakSettings, _case: Case) -> Quantities:
    """Run all parts."""
    rows: Quantities = []
    if settings.load_s > 0.0:
        with tempfile.TemporaryDirectory() as folder:
            rows += _load(settings, Path(folder))
    if settings.testbench_cars > 0:
        with tempfile.TemporaryDirectory() as folder:
            rows += _testbench(settings.testbench_cars, Path(folder))
    if settings.fleet_s > 0.0:
        rows += _fleet(settings.fleet_s)
    return rows


def table(_settings: SoakSettings, rows: Sequence[Quantities]) -> list[QuantityLine]:
    """A line for each quantity."""
    return [QuantityLine(*each) for each in rows[0]]


def summary(results: Results[SoakSettings, Quantities, QuantityLine]) -> str:
    """All quantities, one a line."""
    return "\n".join(f"{line.quantity}: {line.value:.4g} {line.unit}" for line in results.table)


def _load(settings: SoakSettings, folder: Path) -> Quantities:
    result = asyncio.run(load(folder, settings.rate_hz, settings.load_s))
    parts = zip(
        ("unloaded", "loaded"),
        (result.unloaded_ms, result.loaded_ms),
        result.due,
        result.cores,
        strict=True,
    )
    return [
        ("datagrams sent by background traffic", float(result.sent), ""),
        ("datagrams dropped by the kernel", float(result.dropped_by_kernel), ""),
        ("datagrams discarded by the daemon", float(result.discarded), ""),
        *(
            row
            for name, delays_ms, due, cores in parts
            for row in (
                (f"warnings sent, {name}", float(due), ""),
                (f"warnings raised, {name}", float(len(delays_ms)), ""),
                *(
                    (f"warning sent to alarm, {name}, p{part}", _percentile(delays_ms, part), "ms")
                    for part in (50, 90, 99)
                ),
                (f"processor, {name}", cores, "cores"),
            )
        ),
    ]


def _testbench(cars: int, folder: Path) -> Quantities:
    result = asyncio.run(run_daemons(folder, cars, TESTBENCH_S))
    return [
        ("daemons at a time", float(cars), ""),
        ("processor, all", sum(result.cores), "cores"),
        ("memory, the largest", max(result.memory_mib), "MiB"),
        ("messages sent, the least", min(result.sent_per_s), "/s"),
        ("between two messages, the longest", max(result.longest_gaps_s), "s"),
    ]


def _fleet(duration_s: float) -> Quantities:
    fleet = Fleet(np.random.default_rng(1))
    fleet.drive(duration_s / 6.0)
    before = resident_bytes()
    fleet.drive(duration_s * 5.0 / 6.0)
    after = resident_bytes()
    return [
        ("remote vehicles met", float(fleet.remote_vehicles_met), ""),
        ("messages received by each car", float(fleet.messages), ""),
        ("memory after a sixth of the time", before / 2**20, "MiB"),
        ("memory at the end", after / 2**20, "MiB"),
        ("growth", 100.0 * (after / before - 1.0), "%"),
    ]


def _percentile(values: list[float], percentile: int) -> float:
    return float(np.percentile(values, percentile)) if values else float("nan")


STUDY = Study(
    name="soak",
    sentence="What load, many daemons and an hour of traffic do to delays and memory.",
    settings=SoakSettings,
    about_s=about_s,
    case=Case,
    run=run,
    table=table,
    line=QuantityLine,
    summary=summary,
)
