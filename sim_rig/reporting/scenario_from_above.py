"""Writes a run of a scenario as a page with the cars from above, from the traces in its folder."""

import math
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

from onboard.errors import UserError
from sim_rig.reporting.from_above import Animation, MapFrame, check_is_file
from sim_rig.run_log.ground_truth import match_object, perceived_objects
from sim_rig.run_log.run_log import Record, RunLog, read_trace

_RIG = "rig.jsonl"
_LISTED_EVERY_S = 1.0
"""Interval at which perceived objects are traced."""


def show_scenario(folder: Path, page: Path) -> str:
    """Write the page of a run; returns a summary of it.

    Args:
        folder: of the run, as written by `sim-rig run`.
        page: where to write to.

    Raises:
        UserError: the folder holds no such run, a trace cannot be read, or `page` is a folder.
    """
    check_is_file(page)
    log = _read(folder)
    try:
        animation = animate(log)
    except KeyError as missing:
        raise _of_no_run(folder, missing) from missing
    animation.title = folder.resolve().name
    animation.write(page)
    return f"{animation.title}: {animation.frames[-1].at:.0f} s. {animation.summary}"


def animate(log: RunLog) -> Animation:
    """The animation of a run: true positions, and what each car perceived and warned of."""
    frames: dict[float, MapFrame] = {}
    sizes: dict[str, tuple[float, float]] = {}
    paths: dict[str, list[list[float]]] = defaultdict(list)
    states = [record for record in log.rig if record["kind"] == "car_state"]
    for record in states:
        at, car = round(log.at_s(record), 1), record["car"]
        shown = frames.setdefault(at, MapFrame(at, {}, equipped=sorted(log.traces)))
        x, y = round(record["x_m"], 2), round(record["y_m"], 2)
        towards = math.pi / 2 - record["heading_rad"]
        shown.cars[car] = [x, y, round(towards, 3), round(record["speed_m_s"], 2)]
        paths[car].append([x, y])
        sizes[car] = record["length_m"], record["width_m"]
    for record in log.rig:
        frame = frames.get(round(log.at_s(record), 1))
        if record["kind"] == "on_air" and frame is not None:
            frame.sent.append((record["car"], 0))
    truth = replace(log, rig=states)
    for car in log.traces:
        _add_perceived(frames, truth, car)
        _add_warnings(frames, truth, car)
    warned = sorted({each[0] for frame in frames.values() for each in frame.warned})
    return Animation(
        summary=f"Warned: {', '.join(warned) or 'nobody'}.",
        sizes=sizes,
        paths=list(paths.values()),
        frames=list(frames.values()),
    )


def _add_perceived(frames: dict[float, MapFrame], log: RunLog, car: str) -> None:
    """Add each list of perceived objects to the frames until the next one."""
    for objects in perceived_objects(log, car, 0.0, math.inf):
        seen = [(each.true_car, each.source) for each in objects if each.true_car is not None]
        listed_s = objects[0].at_s if objects else math.inf
        for frame in frames.values():
            if listed_s <= frame.at < listed_s + _LISTED_EVERY_S:
                frame.perceived[car] = seen


def _add_warnings(frames: dict[float, MapFrame], log: RunLog, car: str) -> None:
    """Add the alarms of level warning to the frames in which they are active."""
    active: dict[tuple[str, str], str | None] = {}
    alarms = iter([*log.of(car, "alarm"), None])
    alarm: Record | None = next(alarms)
    for frame in frames.values():
        while alarm is not None and log.at_s(alarm) <= frame.at:
            key = alarm["cause"], alarm["vehicle"]
            active.pop(key, None)
            if alarm["level"] == "warning":
                match = match_object(log, car, alarm["vehicle"], log.at_s(alarm))
                active[key] = None if match is None else match.true_car
            alarm = next(alarms)
        if car not in frame.cars:  # not on the road
            continue
        for (cause, _), other in active.items():
            here = frame.cars.get(other or car, frame.cars[car])[:2]
            frame.warned.append((car, cause, True, other, here))


def _read(folder: Path) -> RunLog:
    """The traces of a run."""
    try:
        rig = read_trace(folder / _RIG)
        traces = {
            path.stem: read_trace(path)
            for path in sorted(folder.glob("*.jsonl"))
            if path.name != _RIG
        }
    except OSError as error:
        raise UserError(
            f"{folder}: holds no run of a scenario: {error.filename}: {error.strerror}"
        ) from error
    except ValueError as error:  # no JSON, or not UTF-8
        raise UserError(f"{folder}: a trace is broken: {error}") from error
    try:
        states_s = [each["stamp_s"] for each in rig if each["kind"] == "car_state"]
    except KeyError as missing:
        raise _of_no_run(folder, missing) from missing
    start_s = min(states_s, default=None)
    if start_s is None:
        raise UserError(f"{folder / _RIG}: has no positions of cars")
    return RunLog(start_s, traces, rig, {})


def _of_no_run(folder: Path, missing: KeyError) -> UserError:
    return UserError(f"{folder}: no run of this version: a record has no {missing}")
