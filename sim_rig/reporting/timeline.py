"""Figure of a run: speed of each car, its state in the warning group, warnings and alarms."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from onboard.kinematics.units import KM_H
from sim_rig.run_log.run_log import RunLog
from sim_rig.scenario.schema import Scenario

_COLOURS = {
    "green": "#3a8f3a",
    "red": "#c0392b",
    "blue": "#2c6fbb",
    "yellow": "#d4a017",
    "white": "#999999",
    "grey": "#555555",
}
_STATES = {"regular": "#e4e4e4", "leader": "#9ec9e8", "member": "#b5dca8"}


@dataclass(frozen=True, slots=True)
class StateInterval:
    """Interval in which a car kept one state and group number."""

    from_s: float
    until_s: float
    state: str
    number: int


def draw_timeline(scenario: Scenario, log: RunLog, path: Path) -> None:
    """Write the figure of a run as PNG.

    Args:
        scenario: the scenario of the run.
        log: its run log.
        path: the file; its folder is made.
    """
    cars = list(log.traces)
    figure = Figure(figsize=(10.0, 3.2 + 0.45 * len(cars)), layout="constrained")
    speeds, states = figure.subplots(2, 1, sharex=True, height_ratios=[2.4, 0.45 * len(cars) + 0.3])
    for row, car in enumerate(cars):
        _draw_speed(speeds, scenario, log, car)
        _draw_states(states, scenario, log, car, row)
    speeds.set_ylabel("km/h, as read from the bus")
    speeds.legend(loc="best", ncols=len(cars), frameon=False, fontsize="small")
    states.set_yticks(range(len(cars)), cars)
    states.invert_yaxis()
    states.set_xlim(0.0, scenario.duration_s)
    states.set_xlabel("s        ▼ brakes hard     ▲ is warned     ◆ alarm     ✕ sensor lost")
    figure.suptitle(scenario.title, fontsize="medium", wrap=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def _draw_speed(axes: Axes, scenario: Scenario, log: RunLog, car: str) -> None:
    samples = [(log.at_s(record), record["speed_m_s"] / KM_H) for record in log.of(car, "speed")]
    if samples:
        axes.plot(*zip(*samples, strict=True), lw=1.2, label=car, color=_colour(scenario, car))


def _draw_states(axes: Axes, scenario: Scenario, log: RunLog, car: str, row: int) -> None:
    for interval in state_intervals(log, car, scenario.duration_s):
        axes.barh(
            row,
            interval.until_s - interval.from_s,
            0.8,
            interval.from_s,
            color=_STATES[interval.state],
        )
        if interval.until_s - interval.from_s > 0.04 * scenario.duration_s:
            label = interval.state if interval.state != "member" else f"member {interval.number}"
            axes.text(
                interval.from_s + 0.1, row, label, va="center", fontsize="x-small", color="#444"
            )
    for records, marker, colour in (
        (log.brakings(car, scenario.duration_s), "v", "black"),
        (log.of(car, "warning", 0.0, scenario.duration_s), "^", "#c0392b"),
        (log.of(car, "sensor_lost", 0.0, scenario.duration_s), "x", "#d35400"),
    ):
        at_s = [log.at_s(record) for record in records]
        axes.plot(at_s, [row] * len(at_s), marker, color=colour, ms=6)
    for level, colour in (("caution", "#d4a017"), ("warning", "#c0392b")):
        alarms = log.of(car, "alarm", 0.0, scenario.duration_s, level=level)
        at_s = [log.at_s(record) for record in alarms]
        axes.plot(at_s, [row] * len(at_s), "D", color=colour, ms=5)


def state_intervals(log: RunLog, car: str, end_s: float) -> Iterator[StateInterval]:
    """Yield the states of a car, in order, from the start of the scenario to `end_s`.

    Args:
        log: the run log.
        car: name of the car.
        end_s: end of the last interval, s.
    """
    from_s, state, number = 0.0, "regular", 1
    for record in log.of(car, "transition", until_s=end_s):
        at_s = max(0.0, log.at_s(record))
        current = record["state"], record["group_number"]
        if current != (state, number):
            if at_s > from_s:
                yield StateInterval(from_s, at_s, state, number)
            from_s, (state, number) = at_s, current
    yield StateInterval(from_s, end_s, state, number)


def _colour(scenario: Scenario, car: str) -> str | None:
    """Colour of the car; `None`, for the next of the default cycle, if it is grey."""
    colour = scenario.cars[car].colour
    return None if colour == "grey" else _COLOURS[colour]
