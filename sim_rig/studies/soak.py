"""Load and time: a daemon in a crowd of datagrams, and an hour of cars that come and go."""

import asyncio
import sys
import tempfile
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import Field

from onboard.recorder.reading import Box
from onboard.settings import Settings, parse_settings
from sim_rig.campaign import Workers
from sim_rig.ledger import alarm_stamp_s, braking_of
from sim_rig.live import Desk
from sim_rig.run_log import RunLog
from sim_rig.scenario import Scenario
from sim_rig.studies.results import write_results
from sim_rig.studies.soak_fleet import Fleet, resident_bytes

PERIOD_S = 1.1
"""From brake to brake."""
FIRST_S = 4.0
"""By then the group has formed."""
COLUMNS = ("what", "value", "unit")
Rows = list[tuple[str, float, str]]


class SoakSettings(Settings):
    """One run of the study."""

    load_s: float = Field(20.0, ge=0.0, le=600.0)
    """How long the crowd talks, after as long without it; 0 leaves this part out."""
    rate_hz: float = Field(3000.0, gt=0.0, le=20_000.0)
    """Datagrams a second."""
    signed: bool = True
    """Whether the crowd is one that the car believes, so that every signature is checked."""
    fleet_s: float = Field(3600.0, ge=0.0, le=36_000.0)
    """How long the fleet drives, in virtual time; 0 leaves this part out."""


def run(out_dir: Path, settings: SoakSettings | None, _workers: Workers) -> str:
    """Run both parts and write what they gave."""
    chosen = settings or SoakSettings()
    rows: Rows = []
    if chosen.load_s > 0.0:
        with tempfile.TemporaryDirectory() as folder:
            rows += asyncio.run(_load(chosen, Path(folder)))
    if chosen.fleet_s > 0.0:
        rows += _fleet(chosen.fleet_s)
    write_results(out_dir, COLUMNS, rows, chosen)
    return "\n".join(f"{what}: {value:.4g} {unit}" for what, value, unit in rows)


async def _load(settings: SoakSettings, folder: Path) -> Rows:
    scenario = _scenario(settings.load_s)
    async with Desk(scenario, scenario.seed, folder) as desk:
        config = yaml.safe_load((folder / "red.yaml").read_text("utf-8"))
        port = config["radio"]["listen_port"]
        driving = asyncio.create_task(desk.run())
        while desk.start_s == float("inf") and not driving.done():
            await asyncio.sleep(0.05)
        begin_at = desk.start_s + FIRST_S + settings.load_s
        keys = [str(folder / "keys" / "blue")] if settings.signed else []
        flood = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "sim_rig.flood", str(port)),
            *(f"{settings.rate_hz:g}", f"{settings.load_s:g}", f"{begin_at}", *keys),
            stdout=asyncio.subprocess.PIPE,
        )
        sent, _ = await flood.communicate()
        dropped = _dropped_by_kernel(port)
        await driving
    log = desk.log()
    taken = sum(entry.topic == "/in/wsm" for entry in Box([folder / "box" / "red"]).entries())
    quiet, loaded = (
        _delays_ms(log, FIRST_S + part * settings.load_s, settings.load_s) for part in (0, 1)
    )
    return [
        ("datagrams sent", float(sent), ""),
        ("datagrams dropped by the kernel", float(dropped), ""),
        ("datagrams in the recording, the others' included", float(taken), ""),
        ("warnings due, quiet and loaded", settings.load_s // PERIOD_S, "each"),
        ("warnings, quiet", float(len(quiet)), ""),
        ("warnings, loaded", float(len(loaded)), ""),
        *(
            (f"brake to alarm, {name}, p{percentile}", _percentile(delays, percentile), "ms")
            for name, delays in (("quiet", quiet), ("loaded", loaded))
            for percentile in (50, 99)
        ),
    ]


def _fleet(duration_s: float) -> Rows:
    fleet = Fleet(np.random.default_rng(1))
    fleet.drive(duration_s / 6.0)
    before = resident_bytes()
    fleet.drive(duration_s * 5.0 / 6.0)
    after = resident_bytes()
    return [
        ("strangers met", float(fleet.strangers_met), ""),
        ("messages received by each car", float(fleet.messages), ""),
        ("memory after a sixth of the time", before / 2**20, "MiB"),
        ("memory at the end", after / 2**20, "MiB"),
        ("growth", 100.0 * (after / before - 1.0), "%"),
    ]


def _scenario(load_s: float) -> Scenario:
    """Three model cars in a row, as in the benchmark of the hop; the first brakes all the time."""
    end_s = FIRST_S + 2.0 * load_s
    brakes_s = np.arange(FIRST_S, end_s, PERIOD_S).tolist()
    sawtooth = [((at, 15.0), (at + 0.5, 11.0), (at + 1.0, 15.0)) for at in brakes_s]
    mean_m_s = 15.0 - 2.0 / PERIOD_S
    follows = [(FIRST_S, 15.0), (FIRST_S + 1.0, mean_m_s), (end_s, mean_m_s)]
    speeds = {"green": list(chain.from_iterable(sawtooth)), "red": follows, "blue": follows}
    tree: dict[str, Any] = {
        "title": "A car brakes again and again, and another one is in a crowd.",
        "seed": 1,
        "duration_s": end_s,
        "radio": {"reach_m": 300.0},
        "cars": {
            name: {"tag_id": number, "lane": 1, "start_m": -14.5 * number, "speed_m_s": speed}
            for number, (name, speed) in enumerate(speeds.items())
        },
        "expect": [],
    }
    return parse_settings(tree, Scenario, "soak")


def _delays_ms(log: RunLog, from_s: float, during_s: float) -> list[float]:
    warnings = log.of("red", "warning", from_s, from_s + during_s)
    pairs = ((braking_of(log, warning), warning) for warning in warnings)
    return [(alarm_stamp_s(warning) - brake["stamp_s"]) * 1e3 for brake, warning in pairs if brake]


def _percentile(values: list[float], percentile: int) -> float:
    return float(np.percentile(values, percentile)) if values else float("nan")


def _dropped_by_kernel(port: int) -> int:
    """The last column of /proc/net/udp: what the receive buffer had no room for."""
    for line in Path("/proc/net/udp").read_text("ascii").splitlines()[1:]:
        fields = line.split()
        if int(fields[1].rpartition(":")[2], 16) == port:
            return int(fields[-1])
    return 0
