"""Table I: which kinds of collisions the following cars have.

Of all followers and of car 1 alone, which radio does not help: with brake lights only, with radio
at the paper's access probability, and with a radio without delay.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from onboard.access.rear_end import Array
from sim_rig.studies.campaigns.study import Case, Results, Study
from sim_rig.studies.rakhshan.best_access import (
    BROAD,
    PAPERS_OPTIMUM,
    RakhshanSettings,
    batches,
)
from sim_rig.studies.rakhshan.chain import without_radio_s
from sim_rig.studies.rakhshan.collisions import KINDS, CarBraking, collision_kind
from sim_rig.studies.rakhshan.highway import Drops, RakhshanHighwaySettings, delay_s


@dataclass(frozen=True, slots=True)
class KindsLine:
    """One line of the table: collisions of some cars with one kind of information."""

    information: str
    cars: str
    collision_1_percent: float
    collision_2_percent: float
    collision_3_percent: float
    collision_4_percent: float
    percent: float
    """Of all kinds."""

    @property
    def kinds_percent(self) -> tuple[float, ...]:
        """Of each of `KINDS`."""
        return (
            self.collision_1_percent,
            self.collision_2_percent,
            self.collision_3_percent,
            self.collision_4_percent,
        )


KindsResults = Results[RakhshanSettings, list[KindsLine], KindsLine]


def run(settings: RakhshanSettings, _case: Case) -> list[KindsLine]:
    """Simulate all drops with each kind of information."""
    shares: dict[tuple[str, str], list[Array]] = {}
    for drops in batches(settings, settings.highway):
        for information, delay in (
            ("brake lights only", without_radio_s(drops.reaction_s)),
            ("radio", delay_s(settings.highway, drops, PAPERS_OPTIMUM)),
            ("radio without delay", np.zeros_like(drops.reaction_s)),
        ):
            kinds = _kinds(settings.highway, drops, delay)
            for cars, of_cars in (("all", kinds), ("car 1", kinds[..., :1])):
                of_kind = [(of_cars == kind).mean(axis=(-2, -1)) for kind in KINDS]
                shares.setdefault((information, cars), []).append(np.stack(of_kind))
    lines = []
    for (information, cars), of_batches in shares.items():
        percent = 100.0 * np.concatenate(of_batches, axis=-1).mean(axis=-1)
        lines.append(KindsLine(information, cars, *[*percent.tolist(), float(percent.sum())]))
    return lines


def table(_settings: RakhshanSettings, rows: Sequence[list[KindsLine]]) -> list[KindsLine]:
    """The lines of the only run."""
    return rows[0]


def _kinds(highway: RakhshanHighwaySettings, drops: Drops, delay: Array) -> Array:
    """Kinds (drops, lanes, cars - 1) of the collisions of the following cars."""
    begins_s = delay + drops.reaction_s
    begins_s[..., 0] = 0.0
    lead = CarBraking(drops.braking_m_s2[..., :-1], begins_s[..., :-1])
    follower = CarBraking(drops.braking_m_s2[..., 1:], begins_s[..., 1:])
    return collision_kind(drops.gap_m[..., 1:], highway.speed_m_s, lead, follower).astype(float)


def picture(results: KindsResults) -> Figure:
    """Draw a bar for each line, of one part for each kind."""
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    names = [f"{line.information},\n{line.cars}" for line in results.table]
    left = np.zeros(len(names))
    for k, kind in enumerate(KINDS):
        percent = np.array([line.kinds_percent[k] for line in results.table])
        axes.barh(names, percent, left=left, label=f"collision {kind}")
        left += percent
    axes.set_xlabel("following cars that collide, %")
    axes.legend(frameon=False)
    return figure


def summary(results: KindsResults) -> str:
    """All shares."""
    return "; ".join(
        f"{line.information}, {line.cars}: "
        + ", ".join(f"{value:.1f}" for value in (*line.kinds_percent, line.percent))
        + " %"
        for line in results.table
    )


STUDY = Study(
    name="rakhshan-table1",
    sentence="Table I: which kinds of rear-end collisions happen, with radio and without.",
    settings=RakhshanSettings,
    default=BROAD,
    takes_settings=False,
    case=Case,
    run=run,
    table=table,
    line=KindsLine,
    picture=picture,
    summary=summary,
)
