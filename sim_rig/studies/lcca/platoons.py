"""Membership of the followers of recorded platoons, driven again with the cores of every car.

Each car has the whole stack of `onboard`, in virtual time, with the modelled camera and channel. A
follower is due while its gap is shorter than the safety distance and than `up_to_m`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from onboard.errors import UserError
from onboard.lcca.settings import LccaSettings
from onboard.lcca.transitions import GroupState
from onboard.settings import Settings, parse_settings
from sim_rig.rendering.plate_texts import text_of
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.roads.recording import STEP_S
from sim_rig.roads.trace_files import read_trace
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.sensor_settings import EcuSettings, LensSettings
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.campaigns.campaign import Row, Workers, run_campaign
from sim_rig.studies.campaigns.results import write_results
from sim_rig.studies.lcca.platoon_sight import RECOMMENDED_LENS

COLUMNS = ("recording", "followers", "due_s", "member_share", "joins_per_min", "worst_share")


class PlatoonSettings(Settings):
    """One campaign; a run is one recording with one seed."""

    files: tuple[Path, ...] = Field(min_length=1)
    """Recordings: trace files whose cars drive one after the other in one lane, the first one
    ahead, or files of OpenACC."""
    seeds: Several[int] = (1,)
    """Each recording is run with each of them."""
    up_to_m: float = Field(25.0, gt=0.0)
    """Gap up to which a follower has to be a member."""
    lens: LensSettings = RECOMMENDED_LENS
    """Of every car's camera."""
    ecu: EcuSettings = EcuSettings()
    """How the control unit of a car answers the requests for its speed."""
    loss: float = Field(0.1, ge=0.0, lt=1.0)
    """Of messages on the air; their reach is 300 m."""


@dataclass(frozen=True, slots=True)
class FollowerTimes:
    """One follower over one run."""

    due_s: float
    """Time in which it should be a member."""
    member_s: float
    """Of that, time in which it was one."""
    driven_s: float
    joins: int
    """How often it became a member."""


def run(out_dir: Path, settings: PlatoonSettings | None, workers: Workers) -> str:
    """Drive all recordings and write their table.

    Args:
        out_dir: folder of table, settings and runs.
        settings: recordings and seeds.
        workers: processes or cluster.

    Returns:
        The share of the due time in which followers were members, as a sentence.

    Raises:
        UserError: no recording is named.
    """
    if settings is None:
        raise UserError("no recordings; name them with --files '[FILE.csv, ...]'")
    numbers = range(len(settings.files) * len(settings.seeds))
    rows = run_campaign(run_one, settings, numbers, out_dir / "runs", workers)
    table = [
        _line(file.stem, rows[number * len(settings.seeds) : (number + 1) * len(settings.seeds)])
        for number, file in enumerate(settings.files)
    ]
    write_results(out_dir, COLUMNS, table, settings)
    member_s, due_s = (sum(row[name] for row in rows) for name in ("member_s", "due_s"))
    share = member_s / due_s if due_s else 1.0
    return (
        f"members {share:.1%} of the time inside the safety distance, up to {settings.up_to_m:g} m"
    )


def run_one(settings: PlatoonSettings, number: int) -> Row:
    """Drive one recording with one seed."""
    file_number, seed_number = divmod(number, len(settings.seeds))
    scenario = scenario_of(settings, settings.files[file_number], settings.seeds[seed_number])
    followers = list(follower_times(scenario, run_virtual(scenario), settings.up_to_m).values())
    return {
        "followers": len(followers),
        "due_s": sum(each.due_s for each in followers),
        "member_s": sum(each.member_s for each in followers),
        "driven_s": sum(each.driven_s for each in followers),
        "joins": sum(each.joins for each in followers),
        "worst_share": min(
            (each.member_s / each.due_s for each in followers if each.due_s >= 1.0), default=1.0
        ),
    }


def scenario_of(settings: PlatoonSettings, file: Path, seed: int) -> Scenario:
    """A recording as a scenario, with plates drawn by the seed.

    Args:
        settings: lens and losses.
        file: the recording.
        seed: of the scenario.
    """
    recording = read_trace(file)
    rng = np.random.default_rng(seed)
    tree: dict[str, Any] = {
        "title": "The cars of a recorded platoon drive as they did.",
        "seed": seed,
        "duration_s": recording.end_s,
        "radio": {"reach_m": 300.0, "loss": settings.loss},
        "lens": settings.lens.model_dump(),
        "ecu": settings.ecu.model_dump(),
        "cars": {
            drive.name: {"plate": text_of("LL###LL", rng), "trajectory": str(file)}
            for drive in recording.drives
        },
        "expect": [],
    }
    return parse_settings(tree, Scenario, str(file))


def follower_times(scenario: Scenario, log: RunLog, up_to_m: float) -> Mapping[str, FollowerTimes]:
    """Membership of each follower; every car follows the one that the scenario lists before it.

    Args:
        scenario: of the run.
        log: of the run.
        up_to_m: longest gap at which a follower is due.
    """
    road = BreakpointRoad(scenario)
    headway_s = LccaSettings().parameters().join_headway_s
    counts = {follower: _Count(log, follower) for _, follower in pairwise(scenario.equipped)}
    steps = np.arange(0.0, scenario.duration_s, STEP_S).tolist()
    for at_s in steps:
        states = road.cars_at(at_s)
        for ahead, follower in pairwise(scenario.equipped):
            own, other = states[follower], states[ahead]
            gap_m = own.distance_m(other) - (own.length_m + other.length_m) / 2
            counts[follower].step(at_s, is_due=gap_m < min(headway_s * own.speed_m_s, up_to_m))
    return {
        name: FollowerTimes(
            count.due * STEP_S, count.member * STEP_S, len(steps) * STEP_S, count.joins
        )
        for name, count in counts.items()
    }


class _Count:
    """Steps in which one follower is due, and a member."""

    def __init__(self, log: RunLog, car: str) -> None:
        self._changes = [
            (log.at_s(record), record["state"] == GroupState.MEMBER.value)
            for record in log.of(car, "transition")
        ]
        self._is_member = False
        self.due = self.member = self.joins = 0

    def step(self, at_s: float, *, is_due: bool) -> None:
        while self._changes and self._changes[0][0] <= at_s:
            was_member, (_, self._is_member) = self._is_member, self._changes.pop(0)
            self.joins += self._is_member and not was_member
        self.due += is_due
        self.member += is_due and self._is_member


def _line(name: str, rows: Iterable[Row]) -> list[object]:
    runs = list(rows)
    due_s, member_s, driven_s = (
        sum(row[column] for row in runs) for column in ("due_s", "member_s", "driven_s")
    )
    return [
        name,
        runs[0]["followers"],
        due_s,
        member_s / due_s if due_s else 1.0,
        60.0 * sum(row["joins"] for row in runs) / driven_s,
        min(row["worst_share"] for row in runs),
    ]
