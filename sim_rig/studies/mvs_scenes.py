"""Where the MVS studies take place: the dense crossing and the city of the paper, or our own.

The recordings of others are no part of this repository. Where they are (`RIG_DATA` names the
folder), they are used; otherwise SUMO drives the dense crossing.
"""

import os
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from onboard.errors import UserError
from sim_rig.roads.crossing import CrossingSettings, crossing
from sim_rig.roads.recording import Recording, keep_right, record
from sim_rig.roads.sight import Blocked, Corners
from sim_rig.roads.sources import NAMES, RoadSourceError, open_traffic
from sim_rig.roads.trace_files import read_trace

_DATA = Path(__file__).parents[3] / "shared" / "data"
_CITY_LANE_M = 1.75
"""The city's cars drive along the middle of their roads."""
_DRIVEN_S, _WARM_S = 300.0, 90.0
"""Of a simulation, after it has filled its roads."""
_CORNERS_M = 12.5
"""Buildings stand from here on, beside both roads."""


class Scene(StrEnum):
    """By name."""

    CROSSING = "crossing"
    """Dense: some 100 cars on two six-lane roads; the AIM simulator's where it is there."""
    LIGHTER_CROSSING = "lighter-crossing"
    """The same with some 50 cars; only where AIM's recording is."""
    OWN_CROSSING = "own-crossing"
    """The same from our own car-following model."""
    SUMO_CROSSING = "sumo-crossing"
    """The same from SUMO."""
    CITY = "city"
    """Sparse: the paper's city trace."""


Where = Annotated[Scene | Path, Field(union_mode="left_to_right")]
"""A scene by name, or the file of a trace or of a simulation of SUMO's."""


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A scene that is open."""

    recording: Recording
    blocked: Blocked | None
    origin: str
    """What was driven there."""
    has_lights: bool = True

    @property
    def names(self) -> list[str]:
        """Of all cars, in the order of their coming."""
        return [drive.name for drive in self.recording.drives]


@cache
def open_scene(scene: Where) -> Place:
    """Read or drive it, once in a process; a path is traffic of the user's own.

    Raises:
        UserError: the recording is not there, and nobody else drives this scene.
    """
    if isinstance(scene, Path):
        return _brought(scene)
    traces = Path(os.environ.get("RIG_DATA", _DATA)) / "traces"
    aim = traces / "crossing-signals-100-cars.csv.gz"
    if scene is Scene.CITY:
        city = _there(traces / "city-99-cars.ns2")
        recording = keep_right(read_trace(city), _CITY_LANE_M)
        return Place(recording, None, city.name, has_lights=False)
    if scene is Scene.LIGHTER_CROSSING:
        lighter = _there(traces / "crossing-signals-50-cars.csv.gz")
        return Place(read_trace(lighter), Corners(_CORNERS_M), lighter.name)
    if scene is Scene.CROSSING and aim.is_file():
        return Place(read_trace(aim), Corners(_CORNERS_M), aim.name)
    if scene is Scene.OWN_CROSSING:
        own = crossing(CrossingSettings(), np.random.default_rng(0))
        return Place(record(own, _DRIVEN_S, _WARM_S), Corners(_CORNERS_M), "own crossing")
    from sim_rig.roads.sumo import NETWORKS, SumoTraffic  # noqa: PLC0415 (a large library)

    with SumoTraffic(NETWORKS / "crossing.sumocfg", seed=0) as sumo:
        return Place(record(sumo, _DRIVEN_S, _WARM_S), Corners(_CORNERS_M), "SUMO's crossing")


def _brought(path: Path) -> Place:
    """A trace, a simulation of SUMO's, or a source by name; nothing is known of its buildings."""
    try:
        traffic = open_traffic(str(path), np.random.default_rng(0))
    except RoadSourceError as error:
        names = ", ".join(dict.fromkeys((*Scene, *NAMES)))
        raise UserError(
            f"no scene {str(path)!r}: it is one of {names}, a .sumocfg, or a trace's file"
        ) from error
    with traffic if isinstance(traffic, AbstractContextManager) else nullcontext():
        if not isinstance(traffic, Recording):
            traffic = record(traffic, _DRIVEN_S, _WARM_S)
    return Place(traffic, None, path.name, has_lights=False)


def _there(path: Path) -> Path:
    if not path.is_file():
        raise UserError(f"this scene needs {path} (RIG_DATA names the folder of recordings)")
    return path
