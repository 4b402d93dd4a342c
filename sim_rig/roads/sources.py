"""Movement by name: a source of our own, or the file of a trace."""

from pathlib import Path

import numpy as np

from onboard.errors import UserError
from sim_rig.roads.cars import Traffic
from sim_rig.roads.crossing import CrossingSettings, HighwaySettings, crossing, highway
from sim_rig.roads.trace_files import read_trace

NAMES = ("crossing", "highway")


class RoadSourceError(UserError):
    """There is no such source."""


def open_traffic(source: str, rng: np.random.Generator) -> Traffic:
    """Open `crossing`, `highway`, or a trace's file.

    Raises:
        RoadSourceError: it is none of them.
        TraceError: the file is no recording of cars.
    """
    if source == "crossing":
        return crossing(CrossingSettings(), rng)
    if source == "highway":
        return highway(HighwaySettings(), rng)
    if Path(source).is_file():
        return read_trace(Path(source))
    names = ", ".join(NAMES)
    raise RoadSourceError(
        f"no source of traffic {source!r}: it is one of {names}, or a trace's file"
    )
