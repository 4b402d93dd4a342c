"""Whether a traffic event ends in a crash, by what cars with a radio send and by their share.

One run is one event of one seed under one case. Event, drivers and the order in which cars get a
radio depend on the seed alone, so cases are compared run by run. The two cars that crash without
radios get them in all four ways, each with its probability: who of them has one decides most, and
is left to no draw.
"""

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from pydantic import Field

from onboard.settings import Settings
from sim_rig.roads.crashes import Crash
from sim_rig.roads.events import TrafficEventKind
from sim_rig.scenario.setting_types import Several, Share
from sim_rig.studies.campaigns.study import Axes, Case
from sim_rig.studies.mvs.encounter import EncounterCase, Encounters, EncounterSettings, Method
from sim_rig.studies.mvs.outcomes import CrashOutcome
from sim_rig.studies.mvs.scenes import SceneSource, available_scene
from sim_rig.studies.mvs.world_settings import FooterSize

MOST_COMPARED = 0.4
_PAIR_RADIOS = ((False, False), (True, False), (False, True), (True, True))


class CollisionSettings(Settings):
    """One campaign."""

    seed: int = Field(1, ge=0)
    """Number of the first event; each further event has the next."""
    runs: int = Field(500, ge=1)
    """Events of each kind."""
    kinds: Several[TrafficEventKind] = tuple(TrafficEventKind)
    """Kinds of events."""
    shares: Several[Share] = (0.1, 0.2, 0.3, 0.4, 0.6, 0.8)
    """Shares of the cars with a radio."""
    methods: Several[Method] = (Method.DSRC, Method.OWN, Method.MVS)
    """At every share."""
    compared_at: float | None = Field(default=MOST_COMPARED, gt=0.0, le=1.0)
    """Share at which also MO, RS, other footer sizes and a loss of half of all messages are run."""
    entries: tuple[FooterSize, ...] = (5, 20)
    """M, where it is not 10."""
    unaffected_every: int = Field(1, ge=1, le=100)
    """Events in which radios cannot avoid anything (no crash, or no car that can act has a radio)
    are run with radios only once in so many, with that many times the weight: they show what
    warnings cause."""
    encounter: EncounterSettings = EncounterSettings()
    """What all runs have in common."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CollisionCase(Case):
    """One event under one case; each repetition is a further event of each kind."""

    encounter: EncounterCase


def axes(settings: CollisionSettings) -> Axes:
    """Every kind of event under every case."""
    return {"encounter": encounter_cases(settings)}


def encounter_cases(settings: CollisionSettings) -> list[EncounterCase]:
    """All cases of one seed, each once however often the settings name it."""
    shape = []
    for kind in settings.kinds:
        shape.append(EncounterCase(kind, Method.NONE, 0.0))
        shape += [
            EncounterCase(kind, m, share) for share in settings.shares for m in settings.methods
        ]
        share = settings.compared_at
        if share is not None:
            shape += [
                EncounterCase(kind, m, share) for m in (Method.MEASUREMENTS_ONLY, Method.RANDOM)
            ]
            shape += [
                EncounterCase(kind, Method.MVS, share, entries) for entries in settings.entries
            ]
            shape += [EncounterCase(kind, m, share, loss=0.5) for m in (Method.DSRC, Method.MVS)]
    return [
        case if case.method is Method.NONE else replace(case, pair_radios=radios)
        for case in dict.fromkeys(shape)
        for radios in (_PAIR_RADIOS if case.method is not Method.NONE else (None,))
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class EventRun:
    """What all runs of an event have in common."""

    scene: str
    kind: TrafficEventKind
    method: Method
    share: float
    entries: int
    loss: float
    seed: int
    pair: str | None
    """The two cars that crash without radios, with their scene."""
    pair_radios: tuple[bool, bool] | None
    probability: float
    """Of these radios of the two cars."""
    weight: float
    """How often the run counts; 0 for one that was not simulated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SkippedRun(EventRun):
    """A run that ends as the one without radios, and is not simulated."""

    crash: bool
    outcome: CrashOutcome | None


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedRun(EventRun):
    """A run that is simulated; `EncounterOutcome` says what most of its values mean."""

    crash: bool
    speed_m_s: float | None
    angle_deg: float | None
    """Between the headings of the cars that crash."""
    outcome: CrashOutcome | None
    known_before_s: float | None
    warned_before_s: float | None
    first_warning_s: float | None
    warned: int
    false_warnings: int
    paper_alarm_crash: bool
    paper_alarm_same_pair: bool
    paper_alarm_before_s: float | None
    paper_alarm_false: int
    driven_s: float
    messages: int


CollisionRow = SkippedRun | SimulatedRun


def run(settings: CollisionSettings, case: CollisionCase) -> CollisionRow:
    """Run one event under one case."""
    return run_event(settings, case.encounter, settings.seed + case.repetition)


def run_event(settings: CollisionSettings, case: EncounterCase, seed: int) -> CollisionRow:
    """Run the event of a seed under one case."""
    simulator = encounters(settings.encounter)
    of = simulator.event(case.kind, seed)
    event: dict[str, Any] = {
        "scene": str(of.source),
        "kind": case.kind,
        "method": case.method,
        "share": case.share,
        "entries": case.entries,
        "loss": case.loss,
        "seed": seed,
        "pair_radios": case.pair_radios,
    }
    pair, probability, weight = None, 1.0, 1.0
    if case.pair_radios is not None:
        before, is_unaffected = simulator.without_radios(case, seed)
        pair = _pair(of.source, before)
        probability = _probability(case.share, case.pair_radios, has_pair=before is not None)
        every = settings.unaffected_every if is_unaffected else 1
        is_run = probability > 0.0 and seed % every == 0
        weight = probability * every if is_run else 0.0
        if not is_run:
            result = CrashOutcome.NO_RADIO if before is not None else None
            return SkippedRun(
                **event,
                pair=pair,
                probability=probability,
                weight=weight,
                crash=before is not None,
                outcome=result,
            )
    outcome = simulator.run(case, seed)
    if case.method is Method.NONE:
        pair = _pair(of.source, outcome.crash)
    return SimulatedRun(
        **event,
        pair=pair,
        probability=probability,
        weight=weight,
        crash=outcome.crash is not None,
        speed_m_s=outcome.crash.speed_m_s if outcome.crash else None,
        angle_deg=math.degrees(outcome.crash.angle_rad) if outcome.crash else None,
        outcome=outcome.crash_outcome,
        known_before_s=outcome.known_before_s,
        warned_before_s=outcome.warned_before_s,
        first_warning_s=outcome.first_warning_s,
        warned=outcome.warned,
        false_warnings=outcome.false_warnings,
        paper_alarm_crash=outcome.paper_alarm_crash is not None,
        paper_alarm_same_pair=outcome.paper_alarm_same_pair,
        paper_alarm_before_s=outcome.paper_alarm_before_s,
        paper_alarm_false=outcome.paper_alarm_false,
        driven_s=outcome.driven_s,
        messages=outcome.messages,
    )


@cache
def encounters(settings: EncounterSettings) -> Encounters:
    """The simulator of these settings, created once in a process."""
    return Encounters(settings)


def _pair(source: SceneSource, crash: Crash | None) -> str | None:
    return None if crash is None else "+".join([str(source), *sorted(crash.names)])


def _probability(share: float, pair_radios: tuple[bool, bool], *, has_pair: bool) -> float:
    """Of these radios of the two cars of the crash; an event without a crash is run once."""
    if not has_pair:
        return float(pair_radios == _PAIR_RADIOS[0])
    return math.prod(share if has_radio else 1.0 - share for has_radio in pair_radios)


def with_available_scenes(encounter: EncounterSettings) -> EncounterSettings:
    """The settings with the scenes that are used, given the recordings that are present now."""
    scenes = dict.fromkeys(map(available_scene, encounter.scenes))
    return encounter.model_copy(update={"scenes": tuple(scenes)})
