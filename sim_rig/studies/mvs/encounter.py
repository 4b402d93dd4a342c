"""One traffic event among many cars: which drivers are warned in time, and whether cars crash."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from pydantic import Field

from onboard.brake_request.settings import BrakeRequestSettings
from onboard.lcca.settings import LccaSettings
from onboard.mvs.settings import MvsSettings, Selection, SensingSettings
from onboard.observations import Lead
from onboard.risk.alarm import RELEASE_S, Cause
from onboard.risk.settings import RiskSettings
from onboard.settings import Settings
from onboard.tracking.perceived_object import PerceivedObject
from sim_rig.cars.brake_controller import BRAKE_DELAY_S
from sim_rig.roads.cars import Array, Cars
from sim_rig.roads.crashes import Crash
from sim_rig.roads.disturbed import DisturbedTraffic
from sim_rig.roads.driver import ReactionSettings
from sim_rig.roads.events import TrafficEvent, TrafficEventKind
from sim_rig.roads.paths import DrivePath
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.mvs.bsms import TICK_S
from sim_rig.studies.mvs.driver_warning import DriverWarning, WarningModel
from sim_rig.studies.mvs.events import SampledEvent, event_sample
from sim_rig.studies.mvs.lcca import LccaFleet, LccaRadio
from sim_rig.studies.mvs.outcomes import SAME_POSITION_M, CrashOutcome, CrashPair
from sim_rig.studies.mvs.paper_alarm import paper_alarm
from sim_rig.studies.mvs.profiles import WorldProfile
from sim_rig.studies.mvs.scenes import SceneName, SceneSource
from sim_rig.studies.mvs.world import MvsWorld, WorldSettings

_PATH_M = np.arange(0.0, 61.0, 10.0)
"""Points of the event car's path ahead of it, where other cars may cross."""
_LATER_S = (2.0, 4.0, 6.0)
"""Times after the radios are switched on: fast cars that reach the event are far away at first."""


class Method(StrEnum):
    """What cars with a radio send and use."""

    NONE = "none"
    """No radios."""
    DSRC = "dsrc"
    """BSMs only (plain DSRC)."""
    OWN = "own"
    """BSMs, and own sensors whose detections are not shared."""
    MEASUREMENTS_ONLY = "mo"
    """As `OWN`, and shares direct measurements, chosen at random (MO)."""
    RANDOM = "rs"
    """As `OWN`, and shares evidence, chosen at random (RS)."""
    MVS = "mvs"
    """As `OWN`, and shares evidence, chosen by the paper's selective broadcasting."""
    ONSET = "onset"
    """Drivers who can avoid the crash and have a radio are warned `onset_delay_s` after the event
    begins, with nothing sensed or shared: the most that a warning by then can avoid."""


class EncounterSettings(Settings):
    """What all runs have in common."""

    scenes: Several[SceneSource] = (SceneName.CROSSING,)
    """Their events take turns."""
    warm_s: float = Field(1.2, ge=0.3, le=30.0)
    """Time before the event in which radios are on, so that tracks are established."""
    after_s: float = Field(7.0, ge=1.0, le=30.0)
    """A crash later than this after the event is not counted."""
    watched_s: float = Field(5.0, ge=0.5, le=30.0)
    """Time after the event in which drivers can be warned."""
    near_m: float = Field(80.0, gt=0.0, le=2000.0)
    """Cars that never come nearer than this to the event car's path get no radio, to save time."""
    paper_alarm_horizon_s: float = Field(10.0, gt=0.0, le=30.0)
    """Prediction horizon of the paper's alarm; the paper gives no limit."""
    onset_delay_s: float = Field(0.0, ge=0.0, le=10.0)
    """Of `Method.ONSET`."""
    reactions: ReactionSettings = ReactionSettings()
    """How drivers react to events and warnings."""
    world: WorldProfile = WorldSettings()
    """Sensors and radios, or the name of a profile of sensors."""
    risk: RiskSettings = RiskSettings()
    """Thresholds of the alarms."""
    lcca: LccaSettings = LccaSettings()
    """Of cars whose sensors read plates."""
    brake_request: BrakeRequestSettings | None = None
    """When cars with a radio brake by themselves; without it, they only warn their drivers."""


@dataclass(frozen=True, slots=True)
class EncounterCase:
    """What defines one run, apart from its seed."""

    kind: TrafficEventKind
    method: Method
    share: float
    """Share of the cars with a radio."""
    entries: int = 10
    """M."""
    loss: float = 0.0
    pair_radios: tuple[bool, bool] | None = None
    """Whether each car of the crash without radios has one; None: as drawn, like all others."""


@dataclass(slots=True)
class EncounterOutcome:
    """Result of one run."""

    of: SampledEvent
    crash: Crash | None = None
    crash_outcome: CrashOutcome | None = None
    """What radios change about the crash without radios; None if there is no such crash."""
    known_before_s: float | None = None
    """Time to that crash when a car that could act first perceived the other."""
    warned_before_s: float | None = None
    """Time to that crash when such a car was first warned."""
    first_warning_s: float | None = None
    """Time from the event to the first warning of a car that the event affected."""
    warned: int = 0
    """Warnings of cars that the event affected."""
    false_warnings: int = 0
    """Warnings of cars that the event did not affect, or of no car."""
    paper_alarm_crash: Crash | None = None
    """The crash of the same event if drivers reacted to the paper's true alarms."""
    paper_alarm_same_pair: bool = False
    """Whether the same two cars crash then as without radios."""
    paper_alarm_before_s: float | None = None
    """Time from the paper's first alarm to the crash without radios."""
    paper_alarm_false: int = 0
    """The paper's alarms of cars that the event did not affect, or of no car."""
    driven_s: float = 0.0
    """Driving time of all cars with a radio, summed."""
    messages: int = 0


class IssuedWarning(NamedTuple):
    """A warning of a driver."""

    warned: str
    """Name of the car."""
    cause: Cause
    of: str
    """Name of the perceived object, or of the vehicle of the warning group; empty for the vehicle
    ahead of the camera."""
    position_m: Array
    """(2) of that vehicle, as the warned car takes it."""
    right: bool
    """Whether the event has changed the motion of one of the two."""


RadioTickObserver = Callable[[MvsWorld, DisturbedTraffic, list[IssuedWarning]], None]
"""Called after each tick with radios."""

TickObserver = Callable[[DisturbedTraffic, float], None]
"""Called after each tick without radios, with the time."""


class Encounters:
    """Simulates the events of a sample; loaded once in a process."""

    def __init__(self, settings: EncounterSettings) -> None:
        """Load the scenes."""
        self._settings = settings
        self._sample = event_sample(settings.scenes)
        self._without_radios: dict[tuple[TrafficEventKind, int], Crash | None] = {}

    def event(self, kind: TrafficEventKind, seed: int) -> SampledEvent:
        """The event of a seed: that of this number in the sample."""
        return self._sample.event(kind, seed)

    def run(
        self,
        case: EncounterCase,
        seed: int,
        on_radio_tick: RadioTickObserver | None = None,
        on_tick: TickObserver | None = None,
    ) -> EncounterOutcome:
        """Run one case.

        Event, drivers, and the order in which cars get radios depend on the seed alone.

        Args:
            case: kind of event, method, share of radios, footer size and loss.
            seed: of event, drivers and radios.
            on_radio_tick: called after every tick with radios.
            on_tick: called after every tick without radios, which follow.
        """
        of = self.event(case.kind, seed)
        event, traffic = of.event, self._traffic(of, seed)
        outcome = EncounterOutcome(of)
        if case.method is Method.NONE:
            outcome.crash = self._continue(traffic, event, self._begin_s(event), on_tick)
            self._without_radios[case.kind, seed] = outcome.crash
            return outcome
        before = self._crash_without_radios(case.kind, seed)
        equipped = self._equipped(case, seed, traffic.cars_at(self._begin_s(event)), of)
        pair = None if before is None else CrashPair(before, _can_act(before, of))
        if case.method is Method.ONSET:
            if before is not None and pair is not None:
                warned_at_s = event.at_s + self._settings.onset_delay_s
                for name in equipped:
                    pair.receive_warning(name, warned_at_s)
                warned = {name: warned_at_s for name in equipped if pair.can_act(name)}
                outcome.crash = self._run_with_warnings(case, seed, before, warned)
                outcome.crash_outcome = pair.outcome(outcome.crash, equipped)
            return outcome
        world = self._world(case, seed, traffic, equipped)
        lcca = self._lcca(case, seed, world)
        if lcca is not None:
            lcca.form(of.recording, world.now)
        equipped_cars = _EquippedCars(self._settings, world, traffic, outcome, pair, lcca=lcca)
        while world.now < event.at_s + self._settings.watched_s and traffic.crash is None:
            warnings = equipped_cars.tick()
            if on_radio_tick is not None:
                on_radio_tick(world, traffic, warnings)
        outcome.crash = self._continue(traffic, event, world.now, on_tick)
        if before is not None and pair is not None:
            outcome.crash_outcome = pair.outcome(outcome.crash, equipped)
            outcome.known_before_s, outcome.warned_before_s = pair.lead_times_s()
            outcome.paper_alarm_before_s = pair.paper_alarm_lead_s()
            again = self._run_with_warnings(case, seed, before, pair.paper_alarm_at)
            outcome.paper_alarm_crash = again
            outcome.paper_alarm_same_pair = again is not None and pair.is_same_pair(again)
        return outcome

    def without_radios(self, case: EncounterCase, seed: int) -> tuple[Crash | None, bool]:
        """The crash without radios, and whether no car with a radio could avoid it."""
        before, of = self._crash_without_radios(case.kind, seed), self.event(case.kind, seed)
        if before is None:
            return None, True
        cars = self._traffic(of, seed).cars_at(self._begin_s(of.event))
        equipped = self._equipped(case, seed, cars, of)
        return before, equipped.isdisjoint(_can_act(before, of))

    def _traffic(self, of: SampledEvent, seed: int) -> DisturbedTraffic:
        return DisturbedTraffic(of.recording, of.event, self._settings.reactions, seed)

    def _run_with_warnings(
        self, case: EncounterCase, seed: int, before: Crash, warned_at_s: Mapping[str, float]
    ) -> Crash | None:
        """Simulate the event again; these drivers are warned from then on, and nobody else is."""
        if not warned_at_s:
            return before
        of = self.event(case.kind, seed)
        event, traffic = of.event, self._traffic(of, seed)

        def warn(traffic: DisturbedTraffic, now: float) -> None:
            for name, from_s in warned_at_s.items():
                if from_s <= now <= before.at_s:
                    traffic.warn(name, now)

        return self._continue(traffic, event, self._begin_s(event), warn)

    def _world(
        self, case: EncounterCase, seed: int, traffic: DisturbedTraffic, equipped: set[str]
    ) -> MvsWorld:
        senses = case.method is not Method.DSRC
        of = self.event(case.kind, seed)
        world = MvsWorld(
            traffic,
            equipped,
            self._settings.world.model_copy(update={"senses": senses, "loss": case.loss}),
            _mvs(case),
            seed,
            blocked=of.scene.blocked,
        )
        world.now = self._begin_s(of.event)
        return world

    def _lcca(self, case: EncounterCase, seed: int, world: MvsWorld) -> LccaFleet | None:
        """LCCA of the cars with a radio, if their sensors read plates."""
        settings = world.settings
        if settings.plate_lens is None or not settings.senses:
            return None
        return LccaFleet(
            world.equipped,
            settings.plate_lens,
            self._settings.lcca,
            radio=LccaRadio(settings.reach_m, case.loss),
            speed_step_m_s=settings.bus_speed_step_m_s,
            seed=seed,
        )

    def _begin_s(self, event: TrafficEvent) -> float:
        return max(round(event.at_s - self._settings.warm_s, 1), 0.0)

    def _crash_without_radios(self, kind: TrafficEventKind, seed: int) -> Crash | None:
        """The crash of the same event and drivers; cached, since all cases of a seed need it."""
        if (kind, seed) not in self._without_radios:
            self.run(EncounterCase(kind, Method.NONE, 0.0), seed)
        return self._without_radios[kind, seed]

    def _continue(
        self,
        traffic: DisturbedTraffic,
        event: TrafficEvent,
        now: float,
        on_tick: TickObserver | None = None,
    ) -> Crash | None:
        """Simulate on without radios; a crash later than `after_s` is not counted."""
        end_s = event.at_s + self._settings.after_s
        while now < end_s and traffic.crash is None:
            now = round(now + TICK_S, 3)
            traffic.cars_at(now)
            if on_tick is not None:
                on_tick(traffic, now)
        return traffic.crash if traffic.crash and traffic.crash.at_s <= end_s else None

    def _equipped(self, case: EncounterCase, seed: int, cars: Cars, of: SampledEvent) -> set[str]:
        """The cars with a radio near the event car's path; a larger share adds cars to them.

        The cars of the crash have one by `pair_radios`, if that is given.
        """
        event, drives = of.event, of.recording.drives
        draws = np.random.default_rng([seed, 1]).random(len(drives))
        path = DrivePath(drives[event.car])
        path_m, _ = path.places(path.way_m(event.at_s + event.sooner_s) + _PATH_M)
        near: set[str] = set()
        for then in (cars, *(of.recording.cars_at(cars.at_s + later) for later in _LATER_S)):
            away_m = np.hypot(*(then.middle_m[:, None] - path_m).transpose(2, 0, 1)).min(axis=1)
            near |= {then.names[i] for i in np.flatnonzero(away_m <= self._settings.near_m)}
        have = {d.name for d, drawn in zip(drives, draws, strict=True) if drawn < case.share} & near
        before = self._crash_without_radios(case.kind, seed)
        if before is None or case.pair_radios is None:
            return have
        pair = zip(before.names, case.pair_radios, strict=True)
        return have - set(before.names) | {name for name, has_radio in pair if has_radio}


def _can_act(crash: Crash, of: SampledEvent) -> tuple[str, ...]:
    """The cars of a crash whose drivers can avoid it: not the one that brakes and is hit."""
    brakes = of.recording.drives[of.event.car].name if of.event.deceleration_m_s2 else None
    return tuple(name for name in crash.names if name != brakes)


class _EquippedCars:
    """The cars with a radio: which of them is warned in each tick, and whether rightly."""

    def __init__(
        self,
        settings: EncounterSettings,
        world: MvsWorld,
        traffic: DisturbedTraffic,
        outcome: EncounterOutcome,
        pair: CrashPair | None,
        *,
        lcca: LccaFleet | None,
    ) -> None:
        """Prepare a run.

        Args:
            settings: of all runs.
            world: cars with a radio, and their cores.
            traffic: all cars, with the event.
            outcome: result, which is updated in each tick.
            pair: the cars of the crash without radios; None if there is none.
            lcca: of the cars; None if they have none.
        """
        self._settings = settings
        self._lcca = lcca
        self._world = world
        self._traffic = traffic
        self._outcome = outcome
        self._pair = pair
        self._models: dict[str, WarningModel] = {}
        self._warnings = _OngoingWarnings(RELEASE_S)
        self._paper_alarm = _OngoingWarnings(RELEASE_S)

    def tick(self) -> list[IssuedWarning]:
        """Simulate one tick; returns the warnings that are active in it."""
        world = self._world
        before = self._traffic.cars_at(world.now)
        world.tick()
        self._run_lcca(before)
        self._outcome.messages += len(world.sent)
        self._outcome.driven_s += TICK_S * len(world.cores)
        cars = self._traffic.cars_at(world.now)
        warnings: list[IssuedWarning] = []
        for name, core in world.cores.items():
            at = cars.index(name)
            if at is None:
                continue
            core.update(world.now)
            own, objects = core.host_vehicle(world.now), core.kinematic_info(world.now)
            self._evaluate_paper_alarm(own, objects, cars, at)
            if self._pair is not None and self._pair.can_act(name):
                positions_m = np.array([world.world_position_m(name, car.state) for car in objects])
                self._pair.receive_perceived(name, positions_m, cars)
            model = self._model(cars, at)
            model.receive_speed(world.bsm_sources[name].speeds[-1])
            for message in world.received.get(name, ()):
                model.receive_bsm(message, world.now)
            self._hand_over_reports(name, model)
            active = model.assess(world.fixes[name], own, objects, world.now)
            for request in model.take_brake_requests():
                begin_s = request.stamp_s + BRAKE_DELAY_S
                until_s = begin_s + request.valid_s
                self._traffic.brake(name, begin_s, until_s, request.deceleration_m_s2)
            for warning in active:
                warnings.append(self._issued(cars, at, warning))
                self._warn(name, right=warnings[-1].right)
        return warnings

    def _run_lcca(self, before: Cars) -> None:
        """Run the warning groups during the tick that began with the cars as in `before`."""
        if self._lcca is not None:
            for name, source in self._world.bsm_sources.items():
                for brake in source.hard_brakes:
                    self._lcca.receive_hard_brake(name, brake)
            self._lcca.drive(before, self._world.now)

    def _hand_over_reports(self, name: str, model: WarningModel) -> None:
        """Let the alarms of a car have what its plate camera and its warning group say."""
        for now, report in [] if self._lcca is None else self._lcca.take_reports(name):
            if isinstance(report, Lead):
                model.receive_lead(report, now)
            else:
                model.receive_group_warning(report, now)

    def _issued(self, cars: Cars, at: int, warning: DriverWarning) -> IssuedWarning:
        """Place a warning of the car at index `at` on the plane."""
        name, of = cars.names[at], warning.of
        if isinstance(of, PerceivedObject):
            target, position_m = of.name, self._world.world_position_m(name, of.state)
        elif isinstance(of, Lead):
            gap_m = (of.gap_m or 0.0) + float(cars.length_m[at])  # taken to be as long as this one
            target, position_m = "", cars.middle_m[at] + gap_m * cars.ahead[at]
        else:
            assert self._lcca is not None  # noqa: S101 (it has warned)
            target = self._lcca.name_of(of.origin_id)
            there = cars.index(target)
            position_m = cars.middle_m[at if there is None else there]
        return IssuedWarning(
            name, warning.cause, target, position_m, self._is_right(cars, name, position_m)
        )

    def _model(self, cars: Cars, at: int) -> WarningModel:
        name = cars.names[at]
        if name not in self._models:
            self._models[name] = WarningModel(
                self._settings.risk, *_size_m(cars, at), self._settings.brake_request
            )
            for speed in list(self._world.bsm_sources[name].speeds)[:-1]:
                self._models[name].receive_speed(speed)
        return self._models[name]

    def _warn(self, name: str, *, right: bool) -> None:
        now, outcome = self._world.now, self._outcome
        self._traffic.warn(name, now)
        if right and self._pair is not None:
            self._pair.receive_warning(name, now)
        if not self._warnings.refresh(name, now):
            return
        if not right:
            outcome.false_warnings += 1
            return
        outcome.warned += 1
        if outcome.first_warning_s is None:
            outcome.first_warning_s = round(now - outcome.of.event.at_s, 3)

    def _evaluate_paper_alarm(
        self, own: PerceivedObject | None, objects: list[PerceivedObject], cars: Cars, at: int
    ) -> None:
        """Count the paper's alarm for one driver, and whether it is true."""
        least_m_s, within_s = (
            self._settings.risk.least_speed_m_s,
            self._settings.paper_alarm_horizon_s,
        )
        if own is None or cars.speed_m_s[at] < least_m_s:
            return
        target = paper_alarm(own, objects, _size_m(cars, at), within_s)
        if target is None:
            return
        name, now = cars.names[at], self._world.now
        right = self._is_right(cars, name, self._world.world_position_m(name, target.state))
        if right and self._pair is not None:
            self._pair.receive_paper_alarm(name, now)
        self._outcome.paper_alarm_false += self._paper_alarm.refresh(name, now) and not right

    def _is_right(self, cars: Cars, name: str, target_m: Array) -> bool:
        """Whether the event has changed the motion of a warned car or of the one at `target_m`."""
        if self._traffic.has_moved(name):
            return True
        away_m = np.hypot(*(cars.middle_m - target_m).T)
        nearest = int(away_m.argmin())
        is_matched = away_m[nearest] < SAME_POSITION_M
        return bool(is_matched and self._traffic.is_disturbed(cars.names[nearest]))


class _OngoingWarnings:
    """Drivers with an active warning; one ends after `release_s` without a repetition."""

    def __init__(self, release_s: float) -> None:
        self._release_s = release_s
        self._until: dict[str, float] = {}

    def refresh(self, name: str, now: float) -> bool:
        """Refresh a driver's warning; returns whether it is a new one."""
        is_new = now >= self._until.get(name, -math.inf)
        self._until[name] = now + self._release_s
        return is_new


def _size_m(cars: Cars, at: int) -> tuple[float, float]:
    return float(cars.length_m[at]), float(cars.width_m[at])


def _mvs(case: EncounterCase) -> MvsSettings:
    selections = {
        Method.MEASUREMENTS_ONLY: Selection.MEASUREMENTS_ONLY,
        Method.RANDOM: Selection.RANDOM,
    }
    return MvsSettings(
        selection=selections.get(case.method, Selection.MVS),
        max_entries=0 if case.method in {Method.DSRC, Method.OWN} else case.entries,
        # The study's sensors range to the middle of a car.
        sensing=SensingSettings(face_to_centre_m=0.0, face_to_centre_sigma_m=0.0),
    )
