"""Table II: the best equal access probability at each data rate, and the delay with it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_rig.studies.campaigns.study import Case, Results, Study
from sim_rig.studies.rakhshan.best_access import BROAD, RakhshanSettings, batches
from sim_rig.studies.rakhshan.highway import collision_share_of_delays, delay_s
from sim_rig.studies.rakhshan.slotted import DECODING_THRESHOLD_DB


@dataclass(frozen=True, slots=True)
class DataRateLine:
    """One line of the table: a data rate."""

    data_rate_mbit_s: float
    threshold_db: float
    equal_access: float
    """At which the fewest cars collide."""
    collision_probability: float
    fastest_access: float
    """At which the last car is informed soonest."""
    last_car_delay_ms: float


def run(settings: RakhshanSettings, _case: Case) -> list[DataRateLine]:
    """Simulate each data rate."""
    return [_line(settings, *each) for each in DECODING_THRESHOLD_DB.items()]


def _line(settings: RakhshanSettings, rate_mbit_s: float, threshold_db: float) -> DataRateLine:
    highway = settings.highway.model_copy(
        update={"data_rate_mbit_s": rate_mbit_s, "threshold_db": threshold_db}
    )
    share, last_s = (np.zeros(len(settings.access)) for _ in "ab")
    all_drops = list(batches(settings, highway))
    for drops in all_drops:
        for k, access in enumerate(settings.access):
            delay = delay_s(highway, drops, access)
            share[k] += collision_share_of_delays(drops, delay).mean() / len(all_drops)
            last_s[k] += delay[..., -1].mean() / len(all_drops)
    fastest = int(np.argmin(last_s))
    return DataRateLine(
        data_rate_mbit_s=rate_mbit_s,
        threshold_db=threshold_db,
        equal_access=settings.access[int(np.argmin(share))],
        collision_probability=float(share.min()),
        fastest_access=settings.access[fastest],
        last_car_delay_ms=1e3 * float(last_s[fastest]),
    )


def table(_settings: RakhshanSettings, rows: Sequence[list[DataRateLine]]) -> list[DataRateLine]:
    """The lines of the only run."""
    return rows[0]


def summary(results: Results[RakhshanSettings, list[DataRateLine], DataRateLine]) -> str:
    """The best access probability and the delay at each data rate."""
    return "; ".join(
        f"{line.data_rate_mbit_s:g} Mbit/s: {line.collision_probability:.4f} at"
        f" {line.equal_access:g}, the last car informed after {line.last_car_delay_ms:.0f} ms"
        for line in results.table
    )


STUDY = Study(
    name="rakhshan-table2",
    sentence="Table II: the best access probability at each data rate.",
    settings=RakhshanSettings,
    default=BROAD,
    takes_settings=False,
    about_s=lambda _: 10.0,
    case=Case,
    run=run,
    table=table,
    line=DataRateLine,
    summary=summary,
)
