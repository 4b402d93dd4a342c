"""One run of a collision study from above, as a page that needs no other file."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from onboard.errors import UserError
from onboard.settings import parse_settings, parse_yaml
from sim_rig.campaign import kept_runs
from sim_rig.roads.disturbed import DisturbedTraffic
from sim_rig.studies.mvs_collisions import CollisionSettings, case_of, encounters
from sim_rig.studies.mvs_encounter import Outcome
from sim_rig.studies.mvs_warner import Warned
from sim_rig.studies.mvs_world import MvsWorld

_PAGE = Path(__file__).with_name("show.html")
_NEAREST_M = 4.0
_RUN = "sim_rig.studies.mvs_collisions.run_one"


@dataclass(slots=True)
class _Film:
    """What the page is given: a frame for each tenth of a second."""

    title: str
    event_s: float = 0.0
    event_car: str = ""
    crash: dict[str, object] | None = None
    sizes: dict[str, tuple[float, float]] = field(default_factory=dict)
    frames: list[dict[str, object]] = field(default_factory=list)

    def watch(
        self, world: MvsWorld, traffic: DisturbedTraffic, warned: list[tuple[str, Warned, bool]]
    ) -> None:
        """Take one picture."""
        cars = traffic.cars_at(world.now)
        self._picture(traffic, world.now)
        frame = self.frames[-1]
        frame["radio"] = sorted(world.cores)
        frame["sent"] = [[sent.sender, len(sent.told)] for sent in world.sent]
        frame["warned"] = [[name, told.cause.value, right] for name, told, right in warned]
        known: dict[str, list[tuple[str, str]]] = {}
        for name, core in world.cores.items():
            for car in core.kinematic_info(world.now):
                away = np.hypot(*(cars.middle_m - world.place_of(name, car.state)).T)
                nearest = int(away.argmin())
                if away[nearest] < _NEAREST_M:
                    pair = (cars.names[nearest], car.known_by.value)
                    known.setdefault(name, []).append(pair)
        frame["known"] = known

    def play_on(self, traffic: DisturbedTraffic, outcome: Outcome, seconds: float) -> None:
        """Let the cars drive on for a while without radios, to see how it ends."""
        began = float(str(self.frames[-1]["at"])) if self.frames else outcome.event.at_s - 1.0
        end_s = outcome.crash.at_s + 1.0 if outcome.crash else outcome.event.at_s + seconds
        radios = self.frames[-1]["radio"] if self.frames else []
        for step in range(1, round((end_s - began) * 10) + 1):
            self._picture(traffic, round(began + step / 10, 3))
            self.frames[-1]["radio"] = radios

    def _picture(self, traffic: DisturbedTraffic, at_s: float) -> None:
        cars = traffic.cars_at(at_s)
        places = np.column_stack([cars.middle_m, cars.heading_rad, cars.speed_m_s]).round(3)
        for i, name in enumerate(cars.names):
            self.sizes[name] = float(cars.length_m[i]), float(cars.width_m[i])
        self.frames.append(
            {
                "at": round(at_s, 3),
                "cars": dict(zip(cars.names, places.tolist(), strict=True)),
                "off": [name for name in cars.names if traffic.is_disturbed(name)],
            }
        )


def _settings_of(path: Path) -> CollisionSettings:
    """Those of the campaign that has left its settings at `path`."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(
            f"{path}: cannot be read: {error.strerror}; runs of mvs-figure3 and mvs-figure9 can"
            " be shown, by the folder of the study"
        ) from error
    claim = parse_yaml(data, str(path))
    if not isinstance(claim, dict) or claim.get("run") != _RUN:
        named = claim.get("run") if isinstance(claim, dict) else None
        raise UserError(
            f"{path}: runs of {named or 'what is no campaign'} cannot be shown, only those of"
            " mvs-figure3 and mvs-figure9"
        )
    return parse_settings(claim.get("settings"), CollisionSettings, str(path))


def show_run(folder: Path, number: int, page: Path) -> str:
    """Run one run of a study again and write its page; returns what happened in it.

    Args:
        folder: of the study, as `sim-rig study mvs-figure9` has left it.
        number: of the run, as it stands in `runs/runs.jsonl`.
        page: where to write to.

    Raises:
        UserError: the folder holds no such study, or the study has no such run.
    """
    settings = _settings_of(folder / "runs" / "campaign.yaml")
    if number not in (done := kept_runs(folder / "runs")):
        most = f", the last is {max(done)}" if done else ""
        raise UserError(f"{folder}: no run {number} was done: it holds {len(done)}{most}")
    case, seed = case_of(settings, number)
    film = _Film(f"run {number}: {case.kind.value}, {case.method.value}, {case.share:.0%} radios")
    scene = encounters(settings.encounter)
    traffic: list[DisturbedTraffic] = []
    outcome = scene.run(case, seed, film.watch, traffic.append)
    film.event_s = outcome.event.at_s
    film.event_car = scene.recording.drives[outcome.event.car].name
    film.play_on(traffic[0], outcome, settings.encounter.after_s)
    if outcome.crash is not None:
        film.crash = asdict(outcome.crash)
    data = json.dumps(asdict(film), separators=(",", ":")).replace("<", "\\u003c")
    page.write_text(_PAGE.read_text("utf-8").replace("/*FILM*/null", data), "utf-8")
    if outcome.crash is None:
        return f"{film.title}: no crash"
    one, other = outcome.crash.names
    return f"{film.title}: {one} and {other} crash at {outcome.crash.at_s:.2f} s"
