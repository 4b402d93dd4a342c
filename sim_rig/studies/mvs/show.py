"""Writes one run of a collision study as a page with the cars from above."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from onboard.errors import UserError
from onboard.settings import parse_settings, parse_yaml
from sim_rig.reporting.from_above import Animation, MapFrame, check_is_file
from sim_rig.roads.cars import Array, Cars
from sim_rig.roads.crashes import Crash
from sim_rig.roads.disturbed import DisturbedTraffic
from sim_rig.roads.events import TrafficEvent, TrafficEventKind
from sim_rig.roads.paths import DrivePath
from sim_rig.roads.recording import Trajectory
from sim_rig.studies.campaigns.campaign import stored_runs
from sim_rig.studies.mvs.collisions import CollisionRow, CollisionSettings, encounters
from sim_rig.studies.mvs.encounter import EncounterCase, Encounters, Method
from sim_rig.studies.mvs.equipped_cars import IssuedWarning
from sim_rig.studies.mvs.mvs_figure9_study import STUDY
from sim_rig.studies.mvs.outcomes import SAME_POSITION_M, CrashOutcome, EncounterOutcome
from sim_rig.studies.mvs.world import MvsWorld

_SHOWN = ("mvs-figure3", "mvs-figure9")
_PATH_POINT_EVERY_M = 10.0

_METHODS = {
    Method.DSRC: "plain DSRC",
    Method.OWN: "own sensing",
    Method.MEASUREMENTS_ONLY: "MO",
    Method.RANDOM: "RS",
    Method.MVS: "MVS",
    Method.ONSET: "warned at the onset",
}
_OUTCOMES = {
    CrashOutcome.NO_RADIO: "it happens again: no car that could act has a radio",
    CrashOutcome.UNKNOWN: "it happens again: no radio car that could act perceived the other",
    CrashOutcome.UNWARNED: "it happens again: the other car was perceived, but no driver warned",
    CrashOutcome.TOO_LATE: "it happens again in spite of a warning",
    CrashOutcome.ANOTHER: "these two do not crash, but others do",
    CrashOutcome.AVOIDED: "it is avoided",
}
"""What radios change about the crash without radios, in words."""


class _StudyAnimation(Animation):
    """The animation of a run of a collision study, filled tick by tick."""

    def add_radio_frame(
        self, world: MvsWorld, traffic: DisturbedTraffic, warned: list[IssuedWarning]
    ) -> None:
        """Add a frame of a tick with radios.

        Args:
            world: cores of the cars with a radio.
            traffic: all cars.
            warned: active warnings.
        """
        begun_as_true = {each[0]: each[2] for each in self.frames[-1].warned} if self.frames else {}
        self.add_frame(traffic, world.now)
        cars, frame = traffic.cars_at(world.now), self.frames[-1]
        frame.equipped = sorted(world.cars)
        frame.sent = [(sent.sender, len(sent.entries)) for sent in world.sent]
        estimated_m: dict[tuple[str, str], Array] = {}
        for name, equipped in world.cars.items():
            mvs = equipped.sharing.mvs
            mvs.update(world.now)
            for car in mvs.kinematic_info(world.now):
                position_m = estimated_m[name, car.name] = world.world_position_m(name, car.state)
                if (other := _car_at(cars, position_m)) is not None:
                    frame.perceived.setdefault(name, []).append((other, car.source.value))
        for name, cause, of, begun_m, right in warned:
            # An active warning refers to the state of its target when the warning began.
            position_m = estimated_m.get((name, of), begun_m)
            true = begun_as_true.get(name, right)
            frame.warned.append(
                (name, cause, true, _car_at(cars, position_m), position_m.round(1).tolist())
            )

    def add_frame(self, traffic: DisturbedTraffic, at_s: float) -> None:
        """Add a frame of a tick without radios."""
        cars = traffic.cars_at(at_s)
        states = np.column_stack([cars.middle_m, cars.heading_rad, cars.speed_m_s]).round(3)
        for i, name in enumerate(cars.names):
            self.sizes[name] = float(cars.length_m[i]), float(cars.width_m[i])
        disturbed = [name for name in cars.names if traffic.is_disturbed(name)]
        driving = dict(zip(cars.names, states.tolist(), strict=True))
        self.frames.append(MapFrame(round(at_s, 3), driving, disturbed))


def _car_at(cars: Cars, position_m: Array) -> str | None:
    away_m = np.hypot(*(cars.middle_m - position_m).T)
    nearest = int(away_m.argmin())
    return cars.names[nearest] if away_m[nearest] < SAME_POSITION_M else None


def _settings_of(path: Path) -> CollisionSettings:
    """Settings of the campaign whose `campaign.yaml` is at `path`."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(
            f"{path}: cannot be read: {error.strerror}; runs of mvs-figure3 and mvs-figure9 can"
            " be shown, by the folder of the study"
        ) from error
    campaign = parse_yaml(data, str(path))
    if not isinstance(campaign, dict) or campaign.get("run") not in _SHOWN:
        named = campaign.get("run") if isinstance(campaign, dict) else None
        raise UserError(
            f"{path}: runs of {named or 'something else'} cannot be shown, only those of"
            " mvs-figure3 and mvs-figure9"
        )
    return parse_settings(campaign.get("settings"), CollisionSettings, str(path))


def _row_of(folder: Path, number: int) -> CollisionRow:
    """The stored result of a run."""
    try:
        done = stored_runs(folder / "runs")
    except OSError as error:
        path = folder / "runs" / "runs.jsonl"
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    if number not in done:
        most = f", the last is {max(done)}" if done else ""
        raise UserError(f"{folder}: run {number} was not done: it holds {len(done)}{most}")
    return STUDY.row_of(done[number], f"{folder}, run {number}")


def show_run(folder: Path, number: int, page: Path) -> str:
    """Simulate one run of a study again and write its page; returns a summary of the run.

    Args:
        folder: of the study, as written by `sim-rig study mvs-figure9`.
        number: of the run, as it stands in `runs/runs.jsonl`.
        page: where to write to.

    Raises:
        UserError: the folder holds no such study, the study has no such run, or `page` is a
            folder.
    """
    settings = _settings_of(folder / "runs" / "campaign.yaml")
    row = _row_of(folder, number)
    check_is_file(page)
    of = STUDY.case_of(settings, number)
    case, seed = of.encounter, settings.seed + of.repetition
    animation = _animation(encounters(settings.encounter), case, seed)
    animation.title = _title(number, case)
    # A run that the study skipped (weight 0) is simulated here, and may end differently.
    if row.weight and row.crash != (animation.crash is not None):
        animation.summary += (
            " THE STUDY'S RESULT DIFFERS: its settings or the program have changed."
        )
    animation.write(page)
    return f"{animation.title}\n{animation.summary}"


def _animation(scene: Encounters, case: EncounterCase, seed: int) -> _StudyAnimation:
    animation, without = _StudyAnimation(), _StudyAnimation()
    before = scene.run(replace(case, method=Method.NONE), seed, on_tick=without.add_frame).crash
    outcome = scene.run(case, seed, animation.add_radio_frame, animation.add_frame)
    recording, event = outcome.of.recording, outcome.of.event
    drives = {drive.name: drive for drive in recording.drives}
    animation.event_s = event.at_s
    animation.event_car = recording.drives[event.car].name
    animation.crash = outcome.crash
    outcome_text = _describe_outcome(case, outcome, before)
    animation.summary = f"{animation.event_car} {_describe_event(event)}. {outcome_text}"
    animation.paths = [_path(drives[name]) for name in animation.sizes]
    if before is not None and case.method is not Method.NONE:
        animation.crash_without_radios = before
        animation.frames_without_radios = [
            replace(frame, cars={name: frame.cars[name] for name in before.names}, disturbed=[])
            for frame in without.frames
            if all(name in frame.cars for name in before.names)
        ]
    return animation


def _path(drive: Trajectory) -> list[list[float]]:
    path = DrivePath(drive)
    along_m = np.append(np.arange(0.0, path.length_m, _PATH_POINT_EVERY_M), path.length_m)
    positions_m, _ = path.places(along_m)
    points: list[list[float]] = positions_m.round(1).tolist()
    return points


def _title(number: int, case: EncounterCase) -> str:
    kind = "red-light runner" if case.kind is TrafficEventKind.RED_LIGHT else "sudden braking"
    if case.method is Method.NONE:
        return f"Run {number}: {kind}, no radios"
    of_two = ("neither", "one", "both")[sum(case.pair_radios or ())]
    method = f"{100.0 * case.share:g} % radios ({of_two} of the two cars), {_METHODS[case.method]}"
    if case.method not in {Method.DSRC, Method.OWN}:
        method += f", M = {case.entries}"
    if case.loss:
        method += f", {100.0 * case.loss:g} % of all messages lost"
    return f"Run {number}: {kind}, {method}"


def _describe_event(event: TrafficEvent) -> str:
    if event.kind is TrafficEventKind.SUDDEN_BRAKE:
        return f"brakes with {event.deceleration_m_s2:.1f} m/s²"
    if event.sooner_s:
        return "crosses out of turn"
    return "sets off at a red light" if event.sets_off else "does not stop at a red light"


def _describe_outcome(case: EncounterCase, outcome: EncounterOutcome, before: Crash | None) -> str:
    """The crashes with radios and without, and the effect of the radios."""

    def crash_text(crash: Crash) -> str:
        later_s = crash.at_s - outcome.of.event.at_s
        one, other = crash.names
        return f"{one} and {other} crash {later_s:.1f} s later at {crash.speed_m_s:.1f} m/s"

    now = "no cars crash" if outcome.crash is None else crash_text(outcome.crash)
    if case.method is Method.NONE:
        return f"Without radios {now}."
    if before is None or outcome.crash_outcome is None:
        with_them = ", nor with them" if outcome.crash is None else f"; with them {now}"
        return f"Without radios no cars crash{with_them}."
    text = f"Without radios {crash_text(before)}. With them {_OUTCOMES[outcome.crash_outcome]}"
    if outcome.crash_outcome is CrashOutcome.ANOTHER:
        text += f": {now}"
    if outcome.known_before_s is not None:
        text += (
            f". A car that could act perceived the other {outcome.known_before_s:.1f} s before that"
        )
        text += " crash, and was "
        warned_s = outcome.warned_before_s
        text += "not warned" if warned_s is None else f"warned {warned_s:.1f} s before it"
    return f"{text}."
