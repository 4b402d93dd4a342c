"""One run of a collision study from above, as a page that needs no other file."""

import json
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from onboard.errors import UserError
from onboard.settings import parse_settings, parse_yaml
from sim_rig.roads.cars import Array, Cars
from sim_rig.roads.crashes import Crash
from sim_rig.roads.disturbed import DisturbedTraffic
from sim_rig.roads.events import TrafficEvent, TrafficEventKind
from sim_rig.roads.paths import DrivePath
from sim_rig.roads.recording import Trajectory
from sim_rig.studies.campaign import Row, kept_runs
from sim_rig.studies.mvs_collisions import CollisionSettings, case_of, encounters
from sim_rig.studies.mvs_encounter import EncounterCase, EncounterOutcome, Encounters, Method, Shown
from sim_rig.studies.mvs_outcomes import SAME_PLACE_M, CrashOutcome
from sim_rig.studies.mvs_world import MvsWorld

_PAGE = Path(__file__).with_name("show.html")
_RUN = "sim_rig.studies.mvs_collisions.run_one"
_WAY_EVERY_M = 10.0

_METHODS = {
    Method.DSRC: "plain DSRC",
    Method.OWN: "own sensing",
    Method.MEASUREMENTS_ONLY: "MO",
    Method.RANDOM: "RS",
    Method.MVS: "MVS",
}
_FATES = {
    CrashOutcome.NO_RADIO: "it happens again: nobody who could act has a radio",
    CrashOutcome.UNKNOWN: "it happens again: no car with a radio that could act knew of the other",
    CrashOutcome.UNWARNED: "it happens again: the other car was known, but nobody was warned of it",
    CrashOutcome.TOO_LATE: "it happens again in spite of a warning",
    CrashOutcome.ANOTHER: "these two do not crash, but others do",
    CrashOutcome.AVOIDED: "it is avoided",
}
"""Of the crash without radios."""


@dataclass(slots=True)
class _Frame:
    """All cars at one moment."""

    at: float
    cars: dict[str, list[float]]
    """Middle, heading, and speed."""
    off: list[str]
    """Who no longer keeps to the recording."""
    radio: list[str] | None = None
    """Who has one; none once nobody is warned any more."""
    sent: list[tuple[str, int]] = field(default_factory=list)
    """Senders, and how many entries their messages have."""
    warned: list[tuple[str, str, bool, str | None, list[float]]] = field(default_factory=list)
    """Who, why, whether rightly when it began, of whom, and where that one is believed."""
    known: dict[str, list[tuple[str, str]]] = field(default_factory=dict)
    """Whom each car with a radio knows, and how."""


@dataclass(slots=True)
class _Film:
    """What the page is given: a frame for each tenth of a second, the last at a crash if any."""

    title: str = ""
    event_s: float = 0.0
    event_car: str = ""
    story: str = ""
    """What happens, and how that comes out with radios and without."""
    crash: Crash | None = None
    crash_without_radios: Crash | None = None
    ghosts: list[_Frame] = field(default_factory=list)
    """The cars of that crash, as they drive without radios."""
    sizes: dict[str, tuple[float, float]] = field(default_factory=dict)
    ways: list[list[list[float]]] = field(default_factory=list)
    """Where the cars of the film drive, from the beginning of each drive to its end."""
    frames: list[_Frame] = field(default_factory=list)

    def watch(self, world: MvsWorld, traffic: DisturbedTraffic, warned: list[Shown]) -> None:
        """Take one picture of cars with radios."""
        rightly = {each[0]: each[2] for each in self.frames[-1].warned} if self.frames else {}
        self.play(traffic, world.now)
        cars, frame = traffic.cars_at(world.now), self.frames[-1]
        frame.radio = sorted(world.cores)
        frame.sent = [(sent.sender, len(sent.told)) for sent in world.sent]
        believed_m: dict[tuple[str, str], Array] = {}
        for name, core in world.cores.items():
            for car in core.kinematic_info(world.now):
                place_m = believed_m[name, car.name] = world.place_of(name, car.state)
                if (other := _who_is_at(cars, place_m)) is not None:
                    frame.known.setdefault(name, []).append((other, car.source.value))
        for name, told, right in warned:
            # A warning that is on holds its car as it was when the warning began.
            place_m = believed_m.get((name, told.of.name), world.place_of(name, told.of.state))
            of, why = _who_is_at(cars, place_m), told.cause.value
            frame.warned.append(
                (name, why, rightly.get(name, right), of, place_m.round(1).tolist())
            )

    def play(self, traffic: DisturbedTraffic, at_s: float) -> None:
        """Take one picture of cars as they drive."""
        cars = traffic.cars_at(at_s)
        places = np.column_stack([cars.middle_m, cars.heading_rad, cars.speed_m_s]).round(3)
        for i, name in enumerate(cars.names):
            self.sizes[name] = float(cars.length_m[i]), float(cars.width_m[i])
        off = [name for name in cars.names if traffic.is_disturbed(name)]
        driving = dict(zip(cars.names, places.tolist(), strict=True))
        self.frames.append(_Frame(round(at_s, 3), driving, off))


def _who_is_at(cars: Cars, place_m: Array) -> str | None:
    away_m = np.hypot(*(cars.middle_m - place_m).T)
    nearest = int(away_m.argmin())
    return cars.names[nearest] if away_m[nearest] < SAME_PLACE_M else None


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


def _row_of(folder: Path, number: int) -> Row:
    """What the study has kept of a run."""
    try:
        done = kept_runs(folder / "runs")
    except OSError as error:
        path = folder / "runs" / "runs.jsonl"
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    if number not in done:
        most = f", the last is {max(done)}" if done else ""
        raise UserError(f"{folder}: no run {number} was done: it holds {len(done)}{most}")
    return done[number]


def show_run(folder: Path, number: int, page: Path) -> str:
    """Run one run of a study again and write its page; returns what happened in it.

    Args:
        folder: of the study, as `sim-rig study mvs-figure9` has left it.
        number: of the run, as it stands in `runs/runs.jsonl`.
        page: where to write to.

    Raises:
        UserError: the folder holds no such study, the study has no such run, or the page would
            take the place of a folder.
    """
    settings = _settings_of(folder / "runs" / "campaign.yaml")
    row = _row_of(folder, number)
    if page.is_dir():
        raise UserError(f"{page}: is a folder; name the file to write")
    case, seed = case_of(settings, number)
    film = _filmed(encounters(settings.encounter), case, seed)
    film.title = _title(number, case)
    # A calm run that the study left out is driven here, and may end otherwise.
    if row["weight"] and row["crash"] != (film.crash is not None):
        film.story += " THE STUDY HAS KEPT IT OTHERWISE: its settings or the program have changed."
    data = json.dumps(asdict(film), separators=(",", ":")).replace("<", "\\u003c")
    page.write_text(_PAGE.read_text("utf-8").replace("/*FILM*/null", data), "utf-8")
    return f"{film.title}\n{film.story}"


def _filmed(scene: Encounters, case: EncounterCase, seed: int) -> _Film:
    film, without = _Film(), _Film()
    before = scene.run(replace(case, method=Method.NONE), seed, played=without.play).crash
    outcome = scene.run(case, seed, film.watch, film.play)
    drives = {drive.name: drive for drive in scene.recording.drives}
    film.event_s = outcome.event.at_s
    film.event_car = scene.recording.drives[outcome.event.car].name
    film.crash = outcome.crash
    film.story = f"{film.event_car} {_doing(outcome.event)}. {_came_out(case, outcome, before)}"
    film.ways = [_way(drives[name]) for name in film.sizes]
    if before is not None and case.method is not Method.NONE:
        film.crash_without_radios = before
        film.ghosts = [
            replace(frame, cars={name: frame.cars[name] for name in before.names}, off=[])
            for frame in without.frames
            if all(name in frame.cars for name in before.names)
        ]
    return film


def _way(drive: Trajectory) -> list[list[float]]:
    path = DrivePath(drive)
    places, _ = path.places(np.append(np.arange(0.0, path.length_m, _WAY_EVERY_M), path.length_m))
    way: list[list[float]] = places.round(1).tolist()
    return way


def _title(number: int, case: EncounterCase) -> str:
    kind = "red-light runner" if case.kind is TrafficEventKind.RED_LIGHT else "sudden braking"
    if case.method is Method.NONE:
        return f"Run {number}: {kind}, no radios"
    told = f"{100.0 * case.share:g} % radios, {_METHODS[case.method]}"
    if case.method not in {Method.DSRC, Method.OWN}:
        told += f", M = {case.entries}"
    if case.loss:
        told += f", {100.0 * case.loss:g} % of all messages lost"
    return f"Run {number}: {kind}, {told}"


def _doing(event: TrafficEvent) -> str:
    if event.kind is TrafficEventKind.SUDDEN_BRAKE:
        return f"brakes with {event.deceleration_m_s2:.1f} m/s²"
    if event.sooner_s:
        return "crosses out of turn"
    return "sets off at a red light" if event.sets_off else "does not stop at a red light"


def _came_out(case: EncounterCase, outcome: EncounterOutcome, before: Crash | None) -> str:
    """How it ended, and what the radios had to do with it."""

    def told(crash: Crash) -> str:
        later_s = crash.at_s - outcome.event.at_s
        one, other = crash.names
        return f"{one} and {other} crash {later_s:.1f} s later at {crash.speed_m_s:.1f} m/s"

    now = "nobody crashes" if outcome.crash is None else told(outcome.crash)
    if case.method is Method.NONE:
        return f"Without radios {now}."
    if before is None or outcome.fate is None:
        with_them = ", nor with them" if outcome.crash is None else f"; with them {now}"
        return f"Without radios nobody crashes{with_them}."
    story = f"Without radios {told(before)}. With them {_FATES[outcome.fate]}"
    if outcome.fate is CrashOutcome.ANOTHER:
        story += f": {now}"
    if outcome.known_before_s is not None:
        story += f". Who could act knew of the other {outcome.known_before_s:.1f} s before that"
        story += " crash, and was "
        warned_s = outcome.warned_before_s
        story += "not warned" if warned_s is None else f"warned {warned_s:.1f} s before it"
    return f"{story}."
