"""Where the MVS studies take place: the dense crossing and the city of the paper, or our own.

The recordings of others are no part of this repository; `RIG_DATA` names their folder. Where they
are not, a study of the dense crossing becomes one of SUMO's crossing, and says so in its settings.
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
from sim_rig.roads.crossing import IntersectionSettings, crossing
from sim_rig.roads.line_of_sight import Blocked, Corners
from sim_rig.roads.recording import RecordedTraffic, keep_right, record
from sim_rig.roads.sources import NAMES, RoadSourceError, open_traffic
from sim_rig.roads.trace_files import read_trace

_DATA = Path(__file__).parents[3] / "shared" / "data"
_CITY_LANE_M = 1.75
"""The city's cars drive along the middle of their roads."""
_DRIVEN_S, _WARM_S = 300.0, 90.0
"""Of a simulation, after it has filled its roads."""
_CORNERS_M = 12.5
"""Buildings stand from here on, beside both roads."""


class SceneName(StrEnum):
    """By name."""

    CROSSING = "crossing"
    """Dense: some 100 cars on two six-lane roads; the AIM simulator's."""
    LIGHTER_CROSSING = "lighter-crossing"
    """The same with some 50 cars."""
    OWN_CROSSING = "own-crossing"
    """The same from our own car-following model."""
    SUMO_CROSSING = "sumo-crossing"
    """The same from SUMO."""
    CITY = "city"
    """Sparse: the paper's city trace."""


Where = Annotated[SceneName | Path, Field(union_mode="left_to_right")]
"""A scene by name, or the file of a trace or of a simulation of SUMO's."""


@dataclass(frozen=True, slots=True, eq=False)
class OpenScene:
    """A scene that is open."""

    recording: RecordedTraffic
    blocked: Blocked | None
    origin: str
    """What was driven there."""
    has_lights: bool = True

    @property
    def names(self) -> list[str]:
        """Of all cars, in the order of their coming."""
        return [drive.name for drive in self.recording.drives]


_RECORDED = {
    SceneName.CROSSING: "crossing-signals-100-cars.csv.gz",
    SceneName.LIGHTER_CROSSING: "crossing-signals-50-cars.csv.gz",
    SceneName.CITY: "city-99-cars.ns2",
}


def scene_here(scene: Where) -> Where:
    """What a study of this scene drives where its recordings are as they are now.

    A study asks once, when it begins, and states the answer in its settings: resumed elsewhere, or
    with workers that have other recordings, it must not mix two kinds of traffic.
    """
    if scene is SceneName.CROSSING and not _recorded(scene).is_file():
        return SceneName.SUMO_CROSSING
    return scene


@cache
def open_scene(scene: Where) -> OpenScene:
    """Read or drive it, once in a process; a path is traffic of the user's own.

    Raises:
        UserError: its recording is not there.
    """
    if isinstance(scene, Path):
        return _brought(scene)
    if scene in _RECORDED:
        path = _recorded(scene)
        if not path.is_file():
            raise UserError(f"this scene needs {path} (RIG_DATA names the folder of recordings)")
        if scene is SceneName.CITY:
            recording = keep_right(read_trace(path), _CITY_LANE_M)
            return OpenScene(recording, None, path.name, has_lights=False)
        return OpenScene(read_trace(path), Corners(_CORNERS_M), path.name)
    if scene is SceneName.OWN_CROSSING:
        own = crossing(IntersectionSettings(), np.random.default_rng(0))
        return OpenScene(record(own, _DRIVEN_S, _WARM_S), Corners(_CORNERS_M), "own crossing")
    from sim_rig.roads.sumo import NETWORKS, SumoTraffic  # noqa: PLC0415 (a large library)

    with SumoTraffic(NETWORKS / "crossing.sumocfg", seed=0) as sumo:
        return OpenScene(record(sumo, _DRIVEN_S, _WARM_S), Corners(_CORNERS_M), "SUMO's crossing")


def _brought(path: Path) -> OpenScene:
    """A trace, a simulation of SUMO's, or a source by name; nothing is known of its buildings."""
    try:
        traffic = open_traffic(str(path), np.random.default_rng(0))
    except RoadSourceError as error:
        names = ", ".join(dict.fromkeys((*SceneName, *NAMES)))
        raise UserError(
            f"no scene {str(path)!r}: it is one of {names}, a .sumocfg, or a trace's file"
        ) from error
    with traffic if isinstance(traffic, AbstractContextManager) else nullcontext():
        if not isinstance(traffic, RecordedTraffic):
            traffic = record(traffic, _DRIVEN_S, _WARM_S)
    return OpenScene(traffic, None, path.name, has_lights=False)


def _recorded(scene: SceneName) -> Path:
    return Path(os.environ.get("RIG_DATA", _DATA)) / "traces" / _RECORDED[scene]
