"""Membership of the followers of recorded platoons, driven again with the cores of every car.

Each car has the whole stack of `onboard`, in virtual time, with the modelled camera and channel. A
follower is due while its gap is shorter than the safety distance and than `up_to_m`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

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
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study
from sim_rig.studies.lcca.platoon_sight import RECOMMENDED_LENS


class PlatoonSettings(Settings):
    """One campaign; a run is one recording with one seed."""

    files: Several[Path]
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


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingCase(Case):
    """One recording with one seed."""

    file: Path
    seed: int


def axes(settings: PlatoonSettings) -> Axes:
    """Every recording with every seed."""
    return {"file": settings.files, "seed": settings.seeds}


@dataclass(frozen=True, slots=True)
class PlatoonRow:
    """The followers of one recording with one seed; times are summed over them."""

    followers: int
    due_s: float
    member_s: float
    driven_s: float
    joins: int
    worst_share: float
    """Share of the follower that was a member for the least share of its time."""


@dataclass(frozen=True, slots=True)
class PlatoonLine:
    """One line of the table: a recording with all seeds."""

    recording: str
    followers: int
    due_s: float
    member_share: float
    joins_per_min: float
    worst_share: float


def run(settings: PlatoonSettings, case: RecordingCase) -> PlatoonRow:
    """Drive one recording with one seed."""
    scenario = scenario_of(settings, case.file, case.seed)
    followers = list(follower_times(scenario, run_virtual(scenario), settings.up_to_m).values())
    return PlatoonRow(
        followers=len(followers),
        due_s=sum(each.due_s for each in followers),
        member_s=sum(each.member_s for each in followers),
        driven_s=sum(each.driven_s for each in followers),
        joins=sum(each.joins for each in followers),
        worst_share=min(
            (each.member_s / each.due_s for each in followers if each.due_s >= 1.0), default=1.0
        ),
    )


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


def table(settings: PlatoonSettings, rows: Sequence[PlatoonRow]) -> list[PlatoonLine]:
    """A line for each recording."""
    cases = STUDY.cases(settings)
    return [
        _line(file.stem, [row for case, row in zip(cases, rows, strict=True) if case.file == file])
        for file in settings.files
    ]


def _line(name: str, rows: Sequence[PlatoonRow]) -> PlatoonLine:
    due_s = sum(row.due_s for row in rows)
    return PlatoonLine(
        recording=name,
        followers=rows[0].followers,
        due_s=due_s,
        member_share=sum(row.member_s for row in rows) / due_s if due_s else 1.0,
        joins_per_min=60.0 * sum(row.joins for row in rows) / sum(row.driven_s for row in rows),
        worst_share=min(row.worst_share for row in rows),
    )


def summary(results: Results[PlatoonSettings, PlatoonRow, PlatoonLine]) -> str:
    """The share of the due time in which followers were members."""
    member_s, due_s = (
        sum(getattr(row, name) for row in results.rows) for name in ("member_s", "due_s")
    )
    share = member_s / due_s if due_s else 1.0
    up_to_m = results.settings.up_to_m
    return f"members {share:.1%} of the time inside the safety distance, up to {up_to_m:g} m"


STUDY = Study(
    name="platoons",
    sentence="How much of the time followers in recorded platoons are members of a warning group.",
    settings=PlatoonSettings,
    needs="no recordings; name them with --files '[FILE.csv, ...]'",
    axes=axes,
    case=RecordingCase,
    run=run,
    row=PlatoonRow,
    table=table,
    line=PlatoonLine,
    summary=summary,
)
