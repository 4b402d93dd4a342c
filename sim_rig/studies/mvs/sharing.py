"""Evidence that a car receives about cars without a radio, for the MVS paper's Fig. 8 and Table I.

Fig. 8: the average number of different measurements and estimates (MEs) that a car with a radio
receives about cars without one, by method, footer size M and share of cars with a radio. Table I:
of the MEs about one such car, how many are selected for its estimate, and how many measurements
are thereby counted again. Both count what was sensed or received in one window of 0.1 s.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from pydantic import Field

from onboard.errors import UserError
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.received_footers import SharedEntries, evidence_in
from onboard.mvs.settings import MvsSettings, Selection, SensingSettings
from onboard.settings import Settings
from onboard.tracking.evidence import Measurement, Provenance
from onboard.tracking.independent_set import HasProvenance, PieceT, independent
from sim_rig.roads.cars import Cars
from sim_rig.scenario.setting_types import NotNegative, Several, Share, Span
from sim_rig.studies.campaigns.study import Axes, Case
from sim_rig.studies.mvs.scenes import SceneName, SceneSource, available_scene, open_scene
from sim_rig.studies.mvs.world import ORIGIN, START_UTC_S, MvsWorld
from sim_rig.studies.mvs.world_settings import FooterSize, WorldSettings

_WINDOW_MS = 100
_FARTHEST_M = 3.0
"""Largest distance from an entry to the car that it is attributed to, which is the nearest one."""


class SharingSettings(Settings):
    """One campaign; a run is one seed with one method, M and share."""

    seed: int = Field(1, ge=0)
    """The first seed."""
    seeds: int = Field(3, ge=1)
    """Runs of each method, M and share, each with the next seed."""
    scene: SceneSource = SceneName.CROSSING
    """Whose traffic is simulated: the name of a scene, or a file."""
    shares: Several[Share] = (0.1, 0.2, 0.3, 0.4)
    """Shares of the cars with a radio."""
    entries: Several[FooterSize] = (5, 10, 20)
    """M."""
    methods: Several[Selection] = tuple(Selection)
    """How cars choose what they share."""
    warm_s: float = Field(1.5, ge=0.0, le=60.0)
    """Time in which radios are on before anything is counted."""
    measured_s: float = Field(0.5, gt=0.0, le=300.0)
    """Time in which is counted."""
    begin_s: Span[NotNegative] = (60.0, 240.0)
    """The evaluated part of the scene begins between these, by seed."""
    world: WorldSettings = WorldSettings()
    """Sensors and radios."""


SharingT = TypeVar("SharingT", bound=SharingSettings)


@dataclass(frozen=True, slots=True, kw_only=True)
class SharingCase(Case):
    """One seed with one method, M and share."""

    share: float
    entries: int
    """M."""
    method: Selection
    seed: int


def axes(settings: SharingSettings) -> Axes:
    """Every share, M and method with every seed."""
    return {
        "share": settings.shares,
        "entries": settings.entries,
        "method": settings.methods,
        "seed": range(settings.seed, settings.seed + settings.seeds),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class SharingRow:
    """One seed with one method, M and share: means over cars and windows."""

    method: Selection
    entries: int
    share: float
    seed: int
    cars_with_radio: int
    different: float
    """MEs about cars without a radio that a car receives."""
    reused_in_states: int
    """Measurements that any fused state counts twice."""
    selected_mvs: float
    """MEs about one car that MVS selects."""
    selected_rs: float
    reused_mvs: float
    """Measurements that are thereby counted again."""
    reused_rs: float


def run(settings: SharingSettings, case: SharingCase) -> SharingRow:
    """Simulate one world, and count what each car receives in each window after the warm-up."""
    scene = open_scene(settings.scene)
    end_s = settings.begin_s[1] + settings.warm_s + settings.measured_s
    if end_s > scene.recording.end_s:
        raise UserError(
            f"{scene.origin}: ends after {scene.recording.end_s:g} s, but begin_s, warm_s and"
            f" measured_s need {end_s:g} s"
        )
    rng = np.random.default_rng(case.seed)
    begin_s = round(float(rng.uniform(*settings.begin_s)), 1)
    equipped = {name for name in scene.names if rng.random() < case.share}
    mvs = MvsSettings(
        selection=case.method,
        max_entries=case.entries,
        sensing=SensingSettings(face_to_centre_m=0.0, face_to_centre_sigma_m=0.0),
    )
    world = MvsWorld(
        scene.recording, equipped, settings.world, mvs, case.seed, blocked=scene.blocked
    )
    world.now = begin_s
    for _ in range(round(settings.warm_s / 0.1)):
        world.tick()
    counts = _Counts()
    for _ in range(round(settings.measured_s / 0.1)):
        world.tick()
        counts.count_received(world)
        cores = (car.sharing.mvs for car in world.cars.values())
        counts.count_selected(cores, world.now, rng)
    return SharingRow(
        method=case.method,
        entries=case.entries,
        share=case.share,
        seed=case.seed,
        cars_with_radio=len(world.cars),
        different=_mean(counts.different),
        reused_in_states=counts.reused_in_states,
        selected_mvs=_mean(counts.selected["mvs"]),
        selected_rs=_mean(counts.selected["rs"]),
        reused_mvs=_mean(counts.reused["mvs"]),
        reused_rs=_mean(counts.reused["rs"]),
    )


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else 0.0


class _Counts:
    """Sums over cars and windows."""

    def __init__(self) -> None:
        self.different: list[int] = []
        self.selected: dict[str, list[int]] = {"mvs": [], "rs": []}
        self.reused: dict[str, list[int]] = {"mvs": [], "rs": []}
        self.reused_in_states = 0

    def count_received(self, world: MvsWorld) -> None:
        """Count the different MEs about cars without a radio that each car received in a tick."""
        cars = world.traffic.cars_at(world.now)
        received: dict[str, set[tuple[str, Provenance]]] = {name: set() for name in world.cars}
        for sent in world.sent:
            content = _content(sent.entries, cars, world)
            for receiver in sent.receivers:
                received[receiver] |= content
        self.different += [len(different) for different in received.values()]

    def count_selected(
        self, cores: Iterable[MultiVehicleSensing], now: float, rng: np.random.Generator
    ) -> None:
        """Count the MEs of each track that either method selects."""
        now_ms = round((now + START_UTC_S) * 1000)
        for core in cores:
            core.update(now)
            for track in core.reported_tracks():
                self.reused_in_states += _reused(track.chosen)
                window = [
                    stored
                    for stored in track.evidence.values()
                    if stored.received_ms >= now_ms - _WINDOW_MS
                ]
                if window:
                    for method, chosen in (
                        ("mvs", independent(window)),
                        ("rs", random_until_all(window, rng)),
                    ):
                        self.selected[method].append(len(chosen))
                        self.reused[method].append(_reused(chosen))


def random_until_all(pieces: Sequence[PieceT], rng: np.random.Generator) -> list[PieceT]:
    """The paper's RS: select at random until every measurement has been used."""
    missing = set().union(*(piece.provenance for piece in pieces))
    chosen = []
    for at in rng.permutation(len(pieces)):
        if not missing:
            break
        chosen.append(pieces[at])
        missing -= pieces[at].provenance
    return chosen


def _reused(pieces: Iterable[HasProvenance]) -> int:
    """Repetitions of measurements in the provenance of all pieces together."""
    all_of_them = [identity for piece in pieces for identity in piece.provenance]
    return len(all_of_them) - len(set(all_of_them))


def _content(entries: SharedEntries, cars: Cars, world: MvsWorld) -> set[tuple[str, Provenance]]:
    """The car that each entry is truly about, with the entry's provenance."""
    content = set()
    now_ms = (world.now + START_UTC_S) * 1000
    for piece in evidence_in(entries, ORIGIN):
        position_m = piece.position_m if isinstance(piece, Measurement) else piece.state[:2]
        then = cars.middle_m - (now_ms - piece.stamp_ms) / 1000 * cars.velocity_m_s
        away = np.hypot(*(then - position_m).T)
        nearest = int(away.argmin())
        name = cars.names[nearest]
        if away[nearest] < _FARTHEST_M and name not in world.equipped:
            content.add((name, piece.provenance))
    return content


def prepared(settings: SharingT) -> SharingT:
    """The settings with the scene that is used, given the recordings that are present now."""
    return settings.model_copy(update={"scene": available_scene(settings.scene)})
