"""Warning groups in bends: cars drive in a row into a bend, and the first one brakes hard there.

Each car has the whole stack of `onboard`, in virtual time. The road has no transition curves: its
curvature changes at once, which is harder than on real roads.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Literal

import numpy as np
from pydantic import Field

from onboard.lcca.transitions import GroupState
from onboard.settings import Settings, parse_settings
from sim_rig.rendering.plate_texts import text_of
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study
from sim_rig.studies.lcca.platoon_sight import RECOMMENDED_LENS

LENGTH_M = 4.5
ENTERS_S, BEND_S, BRAKES_S, ENDS_S = 16.0, 16.0, 29.0, 44.0
"""The first car enters the bend, which it takes `BEND_S` to drive, brakes in it, and drives on."""
JOINED_S = 14.0
"""From then on all must be one group."""
LATE_S = 0.5
"""From the detection of the braking; a later warning does not count."""
BRAKING_M_S2, LOST_M_S = 6.0, 6.0
REACTION_S = 0.6
"""From one car's change of speed to the next one's."""
SWAY_M_S = 1.0
"""By which the speeds change in 4 s, passed on from car to car."""
_SIGNALS: Mapping[str, Mapping[str, Any]] = {
    "yaw rate": {"yaw_rate": "TURNING.YAW_RATE"},
    "steering": {"steering_angle": "TURNING.STEERING_ANGLE"},
    "wrong sign": {
        "yaw_rate": "TURNING.YAW_RATE",
        "yaw_rate_positive": "right",
    },
}
Source = Literal["yaw rate", "steering", "GNSS", "wrong sign", "lines", "nothing"]
"""`wrong sign` is a yaw rate of the wrong sign, with GNSS; lanes have lines with `lines` only."""


@dataclass(frozen=True, slots=True)
class Bend:
    """How a row drives through a bend."""

    speed_m_s: float
    gap_m: float


BENDS: Mapping[int, Bend] = {
    150: Bend(16.0, 20.0),
    300: Bend(22.0, 32.0),
    600: Bend(28.0, 40.0),
    1000: Bend(30.0, 40.0),
}
"""By radius in m; the gaps are inside the safety distance, and plates are 43 px wide and more."""


class BendSettings(Settings):
    """One campaign; a run is one row of cars with one seed."""

    radii_m: Several[int] = tuple(BENDS)
    """Radii of the bends; the road has these only."""
    sources: Several[Source] = ("yaw rate", "GNSS", "wrong sign", "lines", "nothing")
    """What measures how the cars turn."""
    seeds: Several[int] = tuple(range(1, 11))
    """Rows of cars in each bend with each source; the seed is that of all draws."""
    cars: int = Field(4, ge=2, le=12)
    """In a row, the first one included."""
    loss: float = Field(0.1, ge=0.0, lt=1.0)
    """Of messages on the air; their reach is 300 m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BendCase(Case):
    """One row."""

    radius_m: int
    source: Source
    seed: int


@dataclass(frozen=True, slots=True)
class BendRow:
    """One row of cars."""

    radius_m: int
    source: Source
    member_share: float
    """Share of the time in which the followers were members of the first car's group."""
    leaves: int
    """How often one left it."""
    warned: int
    """Followers."""
    followers: int
    slowest_s: float | None
    """Latest warning, from the detection of the braking."""

    @property
    def holds(self) -> bool:
        """Whether it was one group all the time, and all were warned."""
        return not self.leaves and self.member_share > 1.0 - 1e-9 and self.warned == self.followers


@dataclass(frozen=True, slots=True)
class BendLine:
    """All rows of one bend."""

    radius_m: int
    gap_m: float
    speed_m_s: float
    source: str
    rows: int
    held: int
    """Rows that were one group all the time, and all warned."""
    all_warned: int
    member_share: float
    leaves: int


def axes(settings: BendSettings) -> Axes:
    """Every bend with every source and every seed."""
    return {
        "radius_m": settings.radii_m,
        "source": settings.sources,
        "seed": settings.seeds,
    }


def run(settings: BendSettings, case: BendCase) -> BendRow:
    """Drive one row through its bend."""
    log = run_virtual(scenario_of(settings, case))
    followers = [f"car{number}" for number in range(2, settings.cars + 1)]
    begins = next(log.brakings("car1"), None)
    delays_s = [] if begins is None else list(_delays_s(log, followers, log.at_s(begins)))
    times = [_times(log, name) for name in followers]
    return BendRow(
        radius_m=case.radius_m,
        source=case.source,
        member_share=sum(member_s for member_s, _ in times) / (ENDS_S - JOINED_S) / len(followers),
        leaves=sum(leaves for _, leaves in times),
        warned=sum(delay_s <= LATE_S for delay_s in delays_s),
        followers=len(followers),
        slowest_s=max(delays_s, default=None),
    )


def scenario_of(settings: BendSettings, case: BendCase) -> Scenario:
    """The row as a scenario; where it starts is drawn by the seed."""
    bend = BENDS[case.radius_m]
    rng = np.random.default_rng(case.seed)
    start_m = float(rng.uniform(0.0, 50.0)) + settings.cars * (bend.gap_m + LENGTH_M)
    from_m = start_m + ENTERS_S * bend.speed_m_s
    signals = _SIGNALS.get(case.source)
    side = 1 if rng.random() < 0.5 else -1
    cars = {
        f"car{number + 1}": {
            "plate": text_of("LL###LL", rng),
            "start_m": start_m - number * (bend.gap_m + LENGTH_M),
            "speed_m_s": _speeds(bend, REACTION_S * number),
        }
        | ({} if signals is None else {"broadcast": {"dbc": "wheel-speeds.dbc", **signals}})
        for number in range(settings.cars)
    }
    tree: dict[str, Any] = {
        "title": "A row of cars drives through a bend, and the first one brakes hard there.",
        "seed": case.seed,
        "duration_s": ENDS_S,
        "radio": {"reach_m": 300.0, "loss": settings.loss},
        "lens": RECOMMENDED_LENS.model_dump(),
        "roads": {
            "road": {
                "bends": [
                    {
                        "from_m": from_m,
                        "until_m": from_m + BEND_S * bend.speed_m_s,
                        "radius_m": side * case.radius_m,
                    }
                ],
                "marked": case.source == "lines",
            }
        },
        "cars": cars,
        "expect": [],
    }
    if case.source in {"GNSS", "wrong sign"}:
        tree["gnss"] = {}
    return parse_settings(tree, Scenario, "bends")


def _speeds(bend: Bend, reaction_s: float) -> Sequence[tuple[float, float]]:
    """Sway, brake after the reaction, and drive as fast as before."""
    at_s, braking_s = BRAKES_S + reaction_s, LOST_M_S / BRAKING_M_S2
    slow_m_s = bend.speed_m_s - LOST_M_S
    sways = (
        (reaction_s + 4.0 * number, bend.speed_m_s + (SWAY_M_S if number % 2 else 0.0))
        for number in range(7)
    )
    return [
        *sways,
        (at_s, bend.speed_m_s),
        (at_s + braking_s, slow_m_s),
        (at_s + braking_s + 3.0, bend.speed_m_s),
    ]


def _delays_s(log: RunLog, followers: Sequence[str], begins_s: float) -> Iterator[float]:
    for name in followers:
        for record in log.of(name, "warning", begins_s, begins_s + 3.0):
            if log.name(record["origin_id"]) == "car1":
                yield log.at_s(record) - begins_s
                break


def _times(log: RunLog, name: str) -> tuple[float, int]:
    """Time as a member of the first car's group from `JOINED_S` on, and how often it left that."""
    member_s, leaves, is_member, at_s = 0.0, 0, False, JOINED_S
    for record in log.of(name, "transition"):
        changes_s = max(log.at_s(record), JOINED_S)
        member_s += is_member * (changes_s - at_s)
        at_s, was_member = changes_s, is_member
        is_member = (
            record["state"] == GroupState.MEMBER.value and log.name(record["leader_id"]) == "car1"
        )
        leaves += was_member and not is_member and changes_s > JOINED_S
    return member_s + is_member * (ENDS_S - at_s), leaves


def table(_: BendSettings, rows: Sequence[BendRow]) -> list[BendLine]:
    """A line for each bend and source."""
    grouped = groupby(rows, key=lambda row: (row.radius_m, row.source))
    return [_line(list(of_one)) for _, of_one in grouped]


def _line(rows: Sequence[BendRow]) -> BendLine:
    one = rows[0]
    bend = BENDS[one.radius_m]
    return BendLine(
        radius_m=one.radius_m,
        gap_m=bend.gap_m,
        speed_m_s=bend.speed_m_s,
        source=one.source,
        rows=len(rows),
        held=sum(row.holds for row in rows),
        all_warned=sum(row.warned == row.followers for row in rows),
        member_share=sum(row.member_share for row in rows) / len(rows),
        leaves=sum(row.leaves for row in rows),
    )


def summary(results: Results[BendSettings, BendRow, BendLine]) -> str:
    """How many rows held, by source."""
    rows = results.rows
    counts = {
        source: [row.holds for row in rows if row.source == source]
        for source in results.settings.sources
    }
    held = ", ".join(f"{source} {sum(each)} of {len(each)}" for source, each in counts.items())
    return f"rows that were one group all the time, and all warned: {held}"


STUDY = Study(
    name="bends",
    sentence="Whether a warning group holds in bends, and all are warned, by what tells the bend.",
    settings=BendSettings,
    axes=axes,
    case=BendCase,
    run=run,
    row=BendRow,
    table=table,
    line=BendLine,
    summary=summary,
)
