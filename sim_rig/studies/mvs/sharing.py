"""The MVS paper's Fig. 8 and Table I: evidence that a car receives about cars without a radio.

Fig. 8: the average number of different measurements and estimates (MEs) that a car with a radio
receives about cars without one, by method, footer size M and share of cars with a radio. Table I:
of the MEs about one such car, how many are selected for its estimate, and how many measurements
are thereby counted again. Both count what was sensed or received in one window of 0.1 s.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from matplotlib.figure import Figure
from pydantic import Field

from onboard.errors import UserError
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.received_footers import SharedEntries, evidence_in
from onboard.mvs.settings import MvsSettings, Selection, SensingSettings
from onboard.settings import Settings
from onboard.tracking.evidence import Evidence, Measurement, Provenance
from onboard.tracking.independent_set import independent
from sim_rig.roads.cars import Cars
from sim_rig.scenario.setting_types import NotNegative, Several, Share, Span
from sim_rig.studies.campaigns.campaign import Row, Workers, run_campaign
from sim_rig.studies.campaigns.intervals import half_interval
from sim_rig.studies.campaigns.results import write_results
from sim_rig.studies.mvs.scenes import SceneName, SceneSource, available_scene, open_scene
from sim_rig.studies.mvs.world import ORIGIN, START_UTC_S, FooterSize, MvsWorld, WorldSettings

PAPER_TABLE_1 = {
    "rs": {"reused": (0.2, 1.2, 4.6, 9.4), "selected": (1.4, 3.5, 7.2, 13.2)},
    "mvs": {"reused": (0.0, 0.0, 0.0, 0.0), "selected": (1.3, 1.7, 3.1, 4.6)},
}
"""At 10, 20, 30 and 40 %."""
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


class Table1Settings(SharingSettings):
    """Table I: cars select as MVS does; the selection that RS would make is counted as well."""

    entries: Several[FooterSize] = (10,)
    methods: Several[Selection] = (Selection.MVS,)


SharingT = TypeVar("SharingT", bound=SharingSettings)


def cases(settings: SharingSettings) -> list[tuple[Selection, int, float, int]]:
    """Method, M, share and seed of each run, by its number."""
    return [
        (method, entries, share, settings.seed + at)
        for share in settings.shares
        for entries in settings.entries
        for method in settings.methods
        for at in range(settings.seeds)
    ]


def run_one(settings: SharingSettings, number: int) -> Row:
    """Simulate one world, and count what each car receives in each window after the warm-up."""
    method, entries, share, seed = cases(settings)[number]
    scene = open_scene(settings.scene)
    end_s = settings.begin_s[1] + settings.warm_s + settings.measured_s
    if end_s > scene.recording.end_s:
        raise UserError(
            f"{scene.origin}: ends after {scene.recording.end_s:g} s, but begin_s, warm_s and"
            f" measured_s need {end_s:g} s"
        )
    rng = np.random.default_rng(seed)
    begin_s = round(float(rng.uniform(*settings.begin_s)), 1)
    equipped = {name for name in scene.names if rng.random() < share}
    mvs = MvsSettings(
        selection=method,
        max_entries=entries,
        sensing=SensingSettings(face_to_centre_m=0.0, face_to_centre_sigma_m=0.0),
    )
    world = MvsWorld(scene.recording, equipped, settings.world, mvs, seed, blocked=scene.blocked)
    world.now = begin_s
    for _ in range(round(settings.warm_s / 0.1)):
        world.tick()
    counts = _Counts()
    for _ in range(round(settings.measured_s / 0.1)):
        world.tick()
        counts.count_received(world)
        counts.count_selected(world.cores.values(), world.now, rng)
    return {
        "method": method.value,
        "entries": entries,
        "share": share,
        "seed": seed,
        "cars_with_radio": len(world.cores),
        **counts.row(),
    }


class _Counts:
    """Sums over cars and windows."""

    def __init__(self) -> None:
        self._different: list[int] = []
        self._selected: dict[str, list[int]] = {"mvs": [], "rs": []}
        self._reused: dict[str, list[int]] = {"mvs": [], "rs": []}
        self._reused_in_state = 0

    def count_received(self, world: MvsWorld) -> None:
        """Count the different MEs about cars without a radio that each car received in a tick."""
        cars = world.traffic.cars_at(world.now)
        received: dict[str, set[tuple[str, Provenance]]] = {name: set() for name in world.cores}
        for sent in world.sent:
            content = _content(sent.entries, cars, world)
            for receiver in sent.receivers:
                received[receiver] |= content
        self._different += [len(different) for different in received.values()]

    def count_selected(
        self, cores: Iterable[MultiVehicleSensing], now: float, rng: np.random.Generator
    ) -> None:
        """Count the MEs of each track that either method selects."""
        now_ms = round((now + START_UTC_S) * 1000)
        for core in cores:
            core.update(now)
            for track in core.reported_tracks():
                self._reused_in_state += _reused(track.used)
                window = [
                    stored.piece
                    for stored in track.evidence.values()
                    if stored.received_ms >= now_ms - _WINDOW_MS
                ]
                if window:
                    for method, chosen in (
                        ("mvs", independent(window)),
                        ("rs", random_until_all(window, rng)),
                    ):
                        self._selected[method].append(len(chosen))
                        self._reused[method].append(_reused(chosen))

    def row(self) -> Row:
        """Means over cars and windows."""
        return {
            "different": float(np.mean(self._different)) if self._different else 0.0,
            "reused_in_states": self._reused_in_state,
            **{
                f"{what}_{method}": float(np.mean(values)) if values else 0.0
                for what, by_method in (("selected", self._selected), ("reused", self._reused))
                for method, values in by_method.items()
            },
        }


def random_until_all(pieces: Sequence[Evidence], rng: np.random.Generator) -> list[Evidence]:
    """The paper's RS: select at random until every measurement has been used."""
    missing = set().union(*(piece.provenance for piece in pieces))
    chosen = []
    for at in rng.permutation(len(pieces)):
        if not missing:
            break
        chosen.append(pieces[at])
        missing -= pieces[at].provenance
    return chosen


def _reused(pieces: Iterable[Evidence]) -> int:
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


class _Line(NamedTuple):
    """One line of the table of Fig. 8."""

    share_with_radio: float
    M: int
    method: str
    different_mes: float
    half_95: float
    """Of the 95 % interval of the mean."""


def figure8(
    out_dir: Path, settings: SharingSettings | None = None, workers: Workers | None = None
) -> str:
    """Write the number of different MEs by method, M and share.

    Args:
        out_dir: folder of table, figure, settings and runs.
        settings: of the campaign; the default ones if None.
        workers: processes or cluster; this process if None.

    Returns:
        In how many cells MVS delivers most, as a sentence.
    """
    settings = _with_available_scene(settings or SharingSettings())
    rows = _all_runs(out_dir, settings, workers)
    table = [
        _Line(
            share,
            entries,
            method.value,
            *_mean_and_error(rows, "different", method, entries, share),
        )
        for share in settings.shares
        for entries in settings.entries
        for method in settings.methods
    ]
    write_results(out_dir, _Line._fields, table, settings, _draw(settings, table))
    cells: dict[tuple[float, int], dict[str, float]] = {}
    for line in table:
        cells.setdefault((line.share_with_radio, line.M), {})[line.method] = line.different_mes
    wins = sum(_mvs_delivers_most(cell) for cell in cells.values())
    return f"MVS delivers most in {wins} of {len(cells)} cells (paper: in all)"


def _mvs_delivers_most(cell: dict[str, float]) -> bool:
    """Whether MVS delivers more MEs than every other method."""
    others = [count for method, count in cell.items() if method != Selection.MVS.value]
    return cell.get(Selection.MVS.value, 0.0) > max(others, default=0.0)


def table1(
    out_dir: Path, settings: Table1Settings | None = None, workers: Workers | None = None
) -> str:
    """Write selected and reused measurements beside the paper's.

    Args:
        out_dir: folder of table, settings and runs.
        settings: of the campaign; the default ones if None.
        workers: processes or cluster; this process if None.

    Returns:
        How many measurements any fused state counts twice, as a sentence.
    """
    settings = _with_available_scene(settings or Table1Settings())
    rows = _all_runs(out_dir, settings, workers)
    table = []
    for method in ("rs", "mvs"):
        for at, share in enumerate(settings.shares):
            mine = [row for row in rows if row["share"] == share]
            paper = [
                PAPER_TABLE_1[method][what][at] if settings.shares == (0.1, 0.2, 0.3, 0.4) else ""
                for what in ("reused", "selected")
            ]
            measured = [
                np.mean([r[f"{what}_{method}"] for r in mine]) for what in ("reused", "selected")
            ]
            table.append(
                (method, share, float(measured[0]), paper[0], float(measured[1]), paper[1])
            )
    columns = ("method", "share_with_radio", "reused", "paper_reused", "selected", "paper_selected")
    write_results(out_dir, columns, table, settings)
    in_states = sum(row["reused_in_states"] for row in rows)
    return f"measurements used twice in any fused state: {in_states}"


def _with_available_scene(settings: SharingT) -> SharingT:
    return settings.model_copy(update={"scene": available_scene(settings.scene)})


def _all_runs(out_dir: Path, settings: SharingSettings, workers: Workers | None) -> list[Row]:
    numbers = range(len(cases(settings)))
    return run_campaign(run_one, settings, numbers, out_dir / "runs", workers or Workers())


def _mean_and_error(
    rows: list[Row], key: str, method: Selection, entries: int, share: float
) -> tuple[float, float]:
    values = [
        row[key]
        for row in rows
        if (row["method"], row["entries"], row["share"]) == (method.value, entries, share)
    ]
    error = half_interval(np.array(values)) if len(values) > 1 else np.nan
    return float(np.mean(values)), float(error)


def _draw(settings: SharingSettings, table: Sequence[_Line]) -> Figure:
    figure = Figure(figsize=(3.0 * len(settings.shares), 3.2), layout="constrained")
    panels = figure.subplots(1, len(settings.shares), sharey=True, squeeze=False)[0]
    for axes, share in zip(panels, settings.shares, strict=True):
        for method in settings.methods:
            mine = [
                line
                for line in table
                if (line.share_with_radio, line.method) == (share, method.value)
            ]
            axes.errorbar(
                [line.M for line in mine],
                [line.different_mes for line in mine],
                [line.half_95 for line in mine],
                marker="o",
                capsize=3,
                label=method.value.upper(),
            )
        axes.set_title(f"{share:.0%} with a radio")
        axes.set_xlabel("M, entries in a footer")
    panels[0].set_ylabel("different MEs received in 0.1 s")
    panels[0].legend()
    return figure
