"""Traffic scenes of the MVS studies: the dense crossing and the city of the paper, or others.

Recorded traces are not part of this repository; `RIG_DATA` names their folder. Without them, a
study of the dense crossing uses SUMO's crossing instead, and its settings file states that.
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
from sim_rig.roads.drivability import drivability
from sim_rig.roads.following import following
from sim_rig.roads.line_of_sight import Blocked, Corners
from sim_rig.roads.recording import RecordedTraffic, record
from sim_rig.roads.retimed import retimed
from sim_rig.roads.right_lane import in_right_lane, keep_right
from sim_rig.roads.sources import NAMES, RoadSourceError, open_traffic
from sim_rig.roads.trace_files import read_trace
from sim_rig.studies.campaigns.progress import report

_DATA = Path(__file__).parents[4] / "shared" / "data"
_CITY_LANE_M = 1.75
"""The city trace has cars in the middle of the road; they are shifted right by this."""
_DRIVEN_S, _WARM_S = 300.0, 90.0
"""Recorded part of a simulation, and the time before it in which its roads fill."""
_CORNERS_M = 12.5
"""Distance of the buildings from the middle of both roads."""


class SceneName(StrEnum):
    """Names of the built-in scenes."""

    CROSSING = "crossing"
    """Dense: some 100 cars on two six-lane roads, from the AIM simulator."""
    LIGHTER_CROSSING = "lighter-crossing"
    """The same with some 50 cars."""
    OWN_CROSSING = "own-crossing"
    """The same from the rig's own car-following model."""
    SUMO_CROSSING = "sumo-crossing"
    """The same from SUMO."""
    SUMO_GRID = "sumo-grid"
    """Nine signalled crossings at oblique angles, some 130 cars, from SUMO; without buildings."""
    CITY = "city"
    """Sparse: the paper's city trace, driven as cars can (`roads/retimed.py`, `following.py`)."""
    CITY_TRACE = "city-trace"
    """The paper's city trace as it is, which no car can drive."""


SceneSource = Annotated[SceneName | Path, Field(union_mode="left_to_right")]
"""A scene by name, or the file of a trace or of a SUMO simulation."""


@dataclass(frozen=True, slots=True, eq=False)
class OpenScene:
    """A loaded scene."""

    recording: RecordedTraffic
    blocked: Blocked | None
    origin: str
    """Where the traffic comes from, for error messages."""
    has_lights: bool = True

    @property
    def remark(self) -> str | None:
        """Say how many of its cars cannot be driven; `None` if all can."""
        found = drivability(self.recording)
        return None if found.can_be_driven else found.line(self.origin)

    @property
    def names(self) -> list[str]:
        """Names of all cars in the order of their appearance."""
        return [drive.name for drive in self.recording.drives]


_CITIES = {SceneName.CITY, SceneName.CITY_TRACE}
_RECORDED = {
    SceneName.CROSSING: "crossing-signals-100-cars.csv.gz",
    SceneName.LIGHTER_CROSSING: "crossing-signals-50-cars.csv.gz",
    SceneName.CITY: "city-99-cars.ns2",
    SceneName.CITY_TRACE: "city-99-cars.ns2",
}


def available_scene(scene: SceneSource) -> SceneSource:
    """The scene that a study uses, given the recordings that are present now.

    A study calls this once at its start and stores the result in its settings, so that resuming it
    elsewhere, or with workers that have other recordings, does not mix two kinds of traffic. A line
    on stderr says how many of its cars could not be driven.
    """
    if scene is SceneName.CROSSING and not _recorded(scene).is_file():
        scene = SceneName.SUMO_CROSSING
    remark = open_scene(scene).remark
    if remark is not None:
        report(remark)
    return scene


@cache
def open_scene(scene: SceneSource) -> OpenScene:
    """Load or simulate a scene, once in a process; a path is a user's own traffic.

    Raises:
        UserError: the scene's recording does not exist.
    """
    if isinstance(scene, Path):
        return _user_scene(scene)
    if scene in _RECORDED:
        path = _recorded(scene)
        if not path.is_file():
            raise UserError(f"this scene needs {path} (RIG_DATA names the folder of recordings)")
        if scene in _CITIES:
            trace = read_trace(path)
            if scene is SceneName.CITY:
                recording = following(retimed(in_right_lane(trace, _CITY_LANE_M)))
            else:
                recording = keep_right(trace, _CITY_LANE_M)
            return OpenScene(recording, None, f"{scene} ({path.name})", has_lights=False)
        return OpenScene(read_trace(path), Corners(_CORNERS_M), path.name)
    if scene is SceneName.OWN_CROSSING:
        own = crossing(IntersectionSettings(), np.random.default_rng(0))
        return OpenScene(record(own, _DRIVEN_S, _WARM_S), Corners(_CORNERS_M), "own crossing")
    from sim_rig.roads.sumo import NETWORKS, SumoTraffic  # noqa: PLC0415 (a large library)

    network = scene.removeprefix("sumo-")
    blocked = Corners(_CORNERS_M) if scene is SceneName.SUMO_CROSSING else None
    with SumoTraffic(NETWORKS / f"{network}.sumocfg", seed=0) as sumo:
        return OpenScene(record(sumo, _DRIVEN_S, _WARM_S), blocked, f"SUMO's {network}")


def _user_scene(path: Path) -> OpenScene:
    """Open a trace, a SUMO simulation, or a traffic source by name; without buildings."""
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
