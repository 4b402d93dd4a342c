"""From the MVS paper's reading of Fig. 9 to the car as shipped, one step at a time.

Steps differ in the sensors, in who brakes (the warned driver only, or the car too by the request of
its alarms), in the alarm (the paper's or the car's), and in the vehicles that count (the two of the
crash, as in the paper, or any). All steps see the same events with the same drivers. Before them
stands what warnings can avoid at best.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from typing import Annotated

from matplotlib.figure import Figure
from pydantic import AfterValidator, Field

from onboard.brake_request.settings import BrakeRequestSettings
from onboard.settings import Settings
from sim_rig.roads.events import TrafficEventKind
from sim_rig.scenario.setting_types import Several, Share
from sim_rig.studies.campaigns.intervals import cluster_interval
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study
from sim_rig.studies.mvs.collision_table import angle_deg, median
from sim_rig.studies.mvs.collisions import (
    CollisionSettings,
    SimulatedRun,
    SkippedRun,
    encounter_cases,
    run_event,
    with_available_scenes,
)
from sim_rig.studies.mvs.encounter import EncounterCase, EncounterSettings, Method
from sim_rig.studies.mvs.outcomes import CrashOutcome
from sim_rig.studies.mvs.profiles import WORLD_PROFILES
from sim_rig.studies.mvs.scenes import SceneName
from sim_rig.studies.mvs.world_settings import WorldSettings

_CROSSING_DEG = 30.0
"""Crashes at smaller angles are rear-end crashes."""


class Driver(StrEnum):
    """Who acts on an alarm."""

    ONSET = "onset"
    """The driver, if warned `onset_delay_s` after the event begins: the most that warnings can
    avoid. No sensor, message or alarm is simulated for it."""
    OBSERVER = "observer"
    """The driver, if warned once an attentive observer of the true states could know of the crash
    (`attentive_observer.py`)."""
    IN_VIEW = "in_view"
    """The driver, if warned once the other vehicle has been in view of a car with a radio: the most
    that warnings by these sensors can avoid."""
    WARNED = "warned"
    """The driver, after the reaction time."""
    BRAKES = "brakes"
    """The car too, as its core requests (docs/design/brake_request.md)."""


_ORACLES = {
    Driver.ONSET: (Method.ONSET, "at the onset"),
    Driver.OBSERVER: (Method.OBSERVER, "observer's"),
    Driver.IN_VIEW: (Method.IN_VIEW, "once in view"),
}
"""Drivers that an oracle warns: the method, and the name of the alarm."""
_SENSE_NOTHING = {Driver.ONSET, Driver.OBSERVER}
Step = tuple[str, Driver]
"""Sensors by the name of their profile, and who acts."""
_NO_PROFILE = "none"
"""Sensors of those."""


def _is_profile(name: str) -> str:
    if name not in WORLD_PROFILES:
        raise ValueError(
            f"no such profile of sensors (given {name!r}): {', '.join(WORLD_PROFILES)}"
        )
    return name


class AblationSettings(Settings):
    """One campaign."""

    seed: int = Field(0, ge=0)
    """Number of the first event."""
    runs: int = Field(100, ge=1)
    """Events of each kind."""
    kinds: Several[TrafficEventKind] = tuple(TrafficEventKind)
    """Kinds of events."""
    share: Share = 0.4
    """Share of cars with a radio."""
    profiles: Several[Annotated[str, AfterValidator(_is_profile)]] = (
        "paper",
        "all-round-120",
        "all-round-60",
        "lidar-120",
        "radar-150",
        "camera-60",
        "plate-camera",
    )
    """Sensors; the paper's alarm is evaluated with the first, for warned drivers."""
    drivers: Several[Driver] = tuple(Driver)
    """Who acts on an alarm."""
    unaffected_every: int = Field(10, ge=1, le=100)
    """As of `mvs-figure9`."""
    encounter: EncounterSettings = EncounterSettings(scenes=(SceneName.CITY,))
    """What all steps have in common; its sensors and its `brake_request` are not used."""


@dataclass(frozen=True, slots=True)
class AblationLine:
    """One line of the table: a step, and the crashes of one kind."""

    crashes: str
    profile: str
    driver: str
    alarm: str
    counted: str
    events: int
    pairs: int
    angle_p10_deg: float
    angle_p50_deg: float
    angle_p90_deg: float
    p_without_radios: float
    avoidable: float
    reduction: float
    reduction_low_95: float
    reduction_high_95: float
    warned_before_s: float
    false_warnings: int
    """Of all runs of the step, not weighted."""
    driven_h: float
    """By all cars with a radio in these runs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AblationCase(Case):
    """One event in one step under one case; each repetition is a further event of each kind."""

    step: Step
    encounter: EncounterCase


def axes(settings: AblationSettings) -> Axes:
    """Every step, with every kind of event, without radios and with them."""
    return {
        "step": _steps(settings),
        "encounter": encounter_cases(_collision(settings, settings.profiles[0], Driver.WARNED)),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class SkippedStep(SkippedRun):
    """A run of a step that is not simulated."""

    profile: str
    driver: Driver


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedStep(SimulatedRun):
    """A run of a step that is simulated."""

    profile: str
    driver: Driver


AblationRow = SkippedStep | SimulatedStep
AblationResults = Results[AblationSettings, AblationRow, AblationLine]


def prepared(settings: AblationSettings) -> AblationSettings:
    """The settings with the scenes that are used."""
    encounter = with_available_scenes(settings.encounter)
    return settings.model_copy(update={"encounter": encounter})


def run(settings: AblationSettings, case: AblationCase) -> AblationRow:
    """Run one event in one step."""
    (profile, driver), encounter = case.step, case.encounter
    if driver in _ORACLES and encounter.method is not Method.NONE:
        encounter = replace(encounter, method=_ORACLES[driver][0])
    collision = _collision(settings, profile, driver)
    row = run_event(collision, encounter, settings.seed + case.repetition)
    values = {each.name: getattr(row, each.name) for each in fields(row)}
    kind = SimulatedStep if isinstance(row, SimulatedRun) else SkippedStep
    return kind(**values, profile=profile, driver=driver)


def _steps(settings: AblationSettings) -> list[Step]:
    """Profiles and drivers that are run; alarms and counting are columns of the same runs."""
    return [
        (profile, driver)
        for driver in settings.drivers
        for profile in ((_NO_PROFILE,) if driver in _SENSE_NOTHING else settings.profiles)
    ]


def _collision(settings: AblationSettings, profile: str, driver: Driver) -> CollisionSettings:
    request = BrakeRequestSettings() if driver is Driver.BRAKES else None
    world = WORLD_PROFILES.get(profile, WorldSettings())
    common = {"world": world, "brake_request": request}
    return CollisionSettings(
        seed=settings.seed,
        kinds=settings.kinds,
        shares=(settings.share,),
        methods=(Method.MVS,),
        compared_at=None,
        unaffected_every=settings.unaffected_every,
        encounter=settings.encounter.model_copy(update=common),
    )


_Event = tuple[str, int]


def table(settings: AblationSettings, rows: Sequence[AblationRow]) -> list[AblationLine]:
    """The lines of all crashes, then those of crossing and of rear-end crashes."""
    before = {_event(row): row for row in rows if row.method is Method.NONE}
    with_radios = [row for row in rows if row.method is not Method.NONE]
    lines = []
    for crashes in ("all", "crossing", "rear-end"):
        events = {
            event: row for event, row in before.items() if crashes in {"all", _kind_of_crash(row)}
        }
        for profile, driver in _steps(settings):
            mine = [
                row
                for row in with_radios
                if (row.profile, row.driver) == (profile, driver) and _event(row) in events
            ]
            is_first = (profile, driver) == (settings.profiles[0], Driver.WARNED)
            alarm = _ORACLES[driver][1] if driver in _ORACLES else "car's"
            counted = [(alarm, "any")]
            if driver is not Driver.BRAKES:
                counted = [(alarm, "two"), *counted]
            if is_first:
                counted = [("paper's", "two"), ("paper's", "any"), *counted]
            lines += [
                _line((crashes, profile, driver.value, alarm, counts), events, mine)
                for alarm, counts in counted
            ]
    return lines


def _event(row: AblationRow) -> _Event:
    return row.kind.value, row.seed


def _kind_of_crash(row: AblationRow) -> str:
    """By the angle of the crash without radios; by the event, if there is none."""
    if isinstance(row, SimulatedRun) and row.angle_deg is not None:
        return "crossing" if row.angle_deg > _CROSSING_DEG else "rear-end"
    return "crossing" if row.kind is TrafficEventKind.RED_LIGHT else "rear-end"


def _line(
    step: tuple[str, str, str, str, str], before: dict[_Event, AblationRow], mine: list[AblationRow]
) -> AblationLine:
    *_, alarm, counted = step
    avoided = dict.fromkeys(before, 0.0)
    for row in mine:
        avoided[_event(row)] += _avoided(row, before[_event(row)], alarm, counted)
    crashed = [float(row.crash) for row in before.values()]
    clusters = [row.pair or event for event, row in before.items()]
    no_radio = [row for row in mine if row.outcome == CrashOutcome.NO_RADIO]
    simulated = [row for row in mine if isinstance(row, SimulatedRun)]
    crashes = sum(crashed)
    low, high = cluster_interval(clusters, list(avoided.values()), crashed)
    return AblationLine(
        *step,
        events=len(before),
        pairs=len({row.pair for row in before.values() if row.pair}),
        angle_p10_deg=angle_deg(before.values(), 10),
        angle_p50_deg=angle_deg(before.values(), 50),
        angle_p90_deg=angle_deg(before.values(), 90),
        p_without_radios=crashes / len(before) if before else math.nan,
        avoidable=1.0 - sum(r.probability for r in no_radio) / crashes if crashes else math.nan,
        reduction=sum(avoided.values()) / crashes if crashes else math.nan,
        reduction_low_95=low,
        reduction_high_95=high,
        warned_before_s=median(simulated, "warned_before_s"),
        false_warnings=sum(row.false_warnings for row in simulated),
        driven_h=sum(row.driven_s for row in simulated) / 3600.0,
    )


def _avoided(row: AblationRow, before: AblationRow, alarm: str, counted: str) -> float:
    """Expected crashes that a run avoids, less those that it causes."""
    if row.outcome is None:  # no crash without radios: a warning may cause one
        counts = alarm != "paper's" and counted == "any"
        return -float(row.weight) * float(row.crash) if counts else 0.0
    if row.outcome == CrashOutcome.NO_RADIO:
        return float(row.weight) * (float(before.crash) - float(row.crash))
    if alarm != "paper's":
        happens = row.crash if counted == "any" else row.outcome not in _TWO_AVOIDED
    else:
        assert isinstance(row, SimulatedRun)  # noqa: S101 (a skipped run has no radio that counts)
        happens = row.paper_alarm_crash if counted == "any" else row.paper_alarm_same_pair
    return 0.0 if happens else float(row.weight)


_TWO_AVOIDED = {CrashOutcome.AVOIDED, CrashOutcome.ANOTHER}


def picture(results: AblationResults) -> Figure:
    """Draw a bar for every step of all crashes, with its interval."""
    lines = [line for line in results.table if line.crashes == "all"]
    figure = Figure(figsize=(7.0, 0.4 * len(lines) + 1.2), layout="constrained")
    axes = figure.subplots()
    names = [f"{line.profile}, {line.driver}, {line.alarm}, {line.counted}" for line in lines]
    shown = [line.reduction for line in lines]
    errors = [
        [line.reduction - line.reduction_low_95 for line in lines],
        [line.reduction_high_95 - line.reduction for line in lines],
    ]
    axes.barh(names, shown, xerr=errors, capsize=3)
    axes.invert_yaxis()
    axes.set_xlabel("reduction of crashes")
    return figure


def summary(results: AblationResults) -> str:
    """The reductions of the first and of the last step."""
    lines = [line for line in results.table if line.crashes == "all"]
    first, last = lines[0], lines[-1]
    return (
        f"from {first.reduction:.1%} ({first.profile}, {first.alarm} alarm) to"
        f" {last.reduction:.1%} ({last.profile}, {last.alarm} alarm) of {first.pairs} pairs"
    )


STUDY = Study(
    name="mvs-ablation",
    sentence="What each step from the paper's reading of Fig. 9 to the car as shipped costs.",
    settings=AblationSettings,
    prepare=prepared,
    axes=axes,
    repeat=lambda settings: settings.runs,
    case=AblationCase,
    run=run,
    row=AblationRow,
    table=table,
    line=AblationLine,
    picture=picture,
    summary=summary,
)
