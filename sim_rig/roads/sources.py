"""Opens a source of traffic by name: a synthetic road, SUMO, or a trace file."""

from pathlib import Path

import numpy as np

from onboard.errors import UserError
from sim_rig.roads.cars import Guests, Traffic, no_guests
from sim_rig.roads.crossing import HighwaySettings, IntersectionSettings, crossing, highway
from sim_rig.roads.trace_files import read_trace

NAMES = ("crossing", "highway", "sumo-crossing", "sumo-highway", "sumo-dense-highway")


class RoadSourceError(UserError):
    """The named source does not exist."""


def open_traffic(
    source: str,
    rng: np.random.Generator,
    guests: Guests = no_guests,
) -> Traffic:
    """Open one of `NAMES`, a SUMO simulation (`.sumocfg`), or a trace file.

    Args:
        source: name or path.
        rng: source of all random numbers.
        guests: other cars, to which the drivers of SUMO react, and those of other sources do not.

    Raises:
        RoadSourceError: the source does not exist.
        SumoError: SUMO cannot run it.
        TraceError: the file is not a valid trace.
    """
    if source == "crossing":
        return crossing(IntersectionSettings(), rng)
    if source == "highway":
        return highway(HighwaySettings(), rng)
    if source in NAMES or source.endswith(".sumocfg"):
        from sim_rig.roads.sumo import NETWORKS, SumoTraffic  # noqa: PLC0415 (a large library)

        name = source.removeprefix("sumo-")
        path = NETWORKS / f"{name}.sumocfg" if source in NAMES else Path(source)
        return SumoTraffic(path, int(rng.integers(2**31)), guests)
    if Path(source).is_file():
        return read_trace(Path(source))
    names = ", ".join(NAMES)
    raise RoadSourceError(
        f"no source of traffic {source!r}: it is one of {names}, a .sumocfg, or a trace file"
    )
