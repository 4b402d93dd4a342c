"""Consistency of the fusion where the errors of the observers' receivers last for half a minute.

NEES (4 is right), share inside the 95 % ellipsoid, ghosts, and the position error beside that of a
central filter, for 1, 2 and 4 observers and errors of 0.5 m over 30 s and 1.5 m over 60 s. Beside
them, white errors alone, and a vehicle that has nothing but its own sensors, relative to itself.
"""

from collections.abc import Iterator

from bench import Figure
from sim_rig.studies.mvs.lasting_errors import Consistency, consistency
from sim_rig.studies.mvs.world_settings import WorldSettings

RUNS = 40
NOISE_M = 0.2
"""White error of a receiver, as that of the rig's."""
SIGHT_M = 90.0


def measure() -> Iterator[Figure]:
    """Yield the figures of each case."""
    for observers in (1, 2, 4):
        for bias_m, time_s in ((0.5, 30.0), (1.5, 60.0)):
            found = consistency(observers, world(bias_m, time_s), RUNS, seed=1)
            yield from _figures(f"{observers}.bias{bias_m:g}m.{time_s:g}s", found)
    white = WorldSettings(sensing_range_m=SIGHT_M)
    yield from _figures("2.white", consistency(2, white, RUNS, seed=1))
    for bias_m in (0.5, 1.5):
        found = consistency(1, world(bias_m, 60.0), RUNS, seed=1, is_alone=True)
        yield from _figures(f"alone.bias{bias_m:g}m.60s", found)


def world(bias_m: float, time_s: float) -> WorldSettings:
    """Return sensors that reach all of the road, and receivers with such errors."""
    return WorldSettings(
        sensing_range_m=SIGHT_M, position_sigma_m=NOISE_M, bias_sigma_m=bias_m, bias_time_s=time_s
    )


def _figures(case: str, found: Consistency) -> Iterator[Figure]:
    name, n = f"lasting_errors.{case}", len(found.reported.nees)
    limit = "the central filter"
    yield Figure(
        f"{name}.position",
        found.reported.position_rmse_m,
        "m",
        n,
        limit,
        found.central.position_rmse_m,
    )
    yield Figure(f"{name}.nees", found.reported.mean_nees, "1", n, limit, found.central.mean_nees)
    yield Figure(f"{name}.inside_95", found.reported.inside_95, "1", n, "a consistent one", 0.95)
    for kind, count in (("ghosts", found.ghosts), ("doubles", found.doubles)):
        share, reference = count / found.objects, "all that is reported"
        yield Figure(f"{name}.{kind}", share, "1", found.objects, reference, 1.0)
    present = found.missed + n
    reference = "those that the central filter has"
    yield Figure(f"{name}.missed", found.missed / present, "1", present, reference, 1.0)
