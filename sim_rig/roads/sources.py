"""Movement by name: a source of our own, SUMO's, or the file of a trace."""

from pathlib import Path

import numpy as np

from onboard.errors import UserError
from sim_rig.roads.cars import Traffic
from sim_rig.roads.crossing import HighwaySettings, IntersectionSettings, crossing, highway
from sim_rig.roads.trace_files import read_trace

NAMES = ("crossing", "highway", "sumo-crossing", "sumo-highway")


class RoadSourceError(UserError):
    """There is no such source."""


def open_traffic(source: str, rng: np.random.Generator) -> Traffic:
    """Open one of `NAMES`, a simulation of SUMO's (`.sumocfg`), or a trace's file.

    Raises:
        RoadSourceError: it is none of them.
        SumoError: SUMO cannot run it.
        TraceError: the file is no recording of cars.
    """
    if source == "crossing":
        return crossing(IntersectionSettings(), rng)
    if source == "highway":
        return highway(HighwaySettings(), rng)
    if source in NAMES or source.endswith(".sumocfg"):
        from sim_rig.roads.sumo import NETWORKS, SumoTraffic  # noqa: PLC0415 (a large library)

        name = source.removeprefix("sumo-")
        path = NETWORKS / f"{name}.sumocfg" if source in NAMES else Path(source)
        return SumoTraffic(path, int(rng.integers(2**31)))
    if Path(source).is_file():
        return read_trace(Path(source))
    names = ", ".join(NAMES)
    raise RoadSourceError(
        f"no source of traffic {source!r}: it is one of {names}, a .sumocfg, or a trace's file"
    )
