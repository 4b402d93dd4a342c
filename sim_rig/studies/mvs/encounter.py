"""One traffic event among many cars: which drivers are warned in time, and whether cars crash."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from operator import itemgetter

import numpy as np
from pydantic import Field

from onboard.brake_request.settings import BrakeRequestSettings
from onboard.lcca.settings import LccaSettings
from onboard.mvs.settings import MvsSettings, Selection, SensingSettings
from onboard.risk.settings import RiskSettings
from onboard.settings import Settings
from sim_rig.roads.cars import Cars
from sim_rig.roads.crashes import Crash
from sim_rig.roads.disturbed import DisturbedTraffic
from sim_rig.roads.driver import ReactionSettings
from sim_rig.roads.events import TrafficEvent, TrafficEventKind
from sim_rig.roads.paths import DrivePath
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.mvs.attentive_observer import AttentiveObserver
from sim_rig.studies.mvs.equipped_cars import EquippedCars, IssuedWarning
from sim_rig.studies.mvs.events import SampledEvent, event_sample
from sim_rig.studies.mvs.lcca import LccaFleet
from sim_rig.studies.mvs.outcomes import CrashPair, EncounterOutcome
from sim_rig.studies.mvs.profiles import WorldProfile
from sim_rig.studies.mvs.ranging_sensor import RangingSensor
from sim_rig.studies.mvs.sampled_bus import TICK_S
from sim_rig.studies.mvs.scenes import SceneName, SceneSource
from sim_rig.studies.mvs.world import MvsWorld
from sim_rig.studies.mvs.world_settings import WorldSettings
from sim_rig.studies.radio.lossy_reach import LossyReach

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
    OBSERVER = "observer"
    """They are warned when an attentive observer of the true states could first know of it."""
    IN_VIEW = "in_view"
    """They are warned at the onset if the other car has a radio, or else once cars with a radio
    have had it in view for `_IN_VIEW_S`: the most that these sensors allow."""


_ORACLES = {Method.ONSET, Method.OBSERVER, Method.IN_VIEW}
_IN_VIEW_S = 1.0


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
        if case.method in _ORACLES:
            if before is not None and pair is not None:
                outcome.crash = self._run_oracle(case, seed, before, pair, equipped)
                outcome.crash_outcome = pair.outcome(outcome.crash, equipped)
                _, outcome.warned_before_s = pair.lead_times_s()
            return outcome
        world = self._world(case, seed, traffic, equipped)
        lcca = self._lcca(case, seed, world)
        if lcca is not None:
            lcca.form(of.recording, world.now)
        equipped_cars = EquippedCars(
            world,
            traffic,
            outcome,
            pair,
            lcca,
            risk=self._settings.risk,
            brake_request=self._settings.brake_request,
            paper_alarm_horizon_s=self._settings.paper_alarm_horizon_s,
        )
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

    def _run_oracle(
        self, case: EncounterCase, seed: int, before: Crash, pair: CrashPair, equipped: set[str]
    ) -> Crash | None:
        """Let an oracle warn who can avoid the crash `before` and has a radio; return the crash."""
        able = [name for name in equipped if pair.can_act(name)]
        warned_at_s = dict.fromkeys(able, self.event(case.kind, seed).event.at_s)
        if case.method is Method.ONSET:
            warned_at_s = {
                name: at_s + self._settings.onset_delay_s for name, at_s in warned_at_s.items()
            }
        elif case.method is Method.OBSERVER:
            known_at_s = self._observed_at_s(case.kind, seed, before)
            warned_at_s = {} if known_at_s is None else dict.fromkeys(able, known_at_s)
        else:
            in_view_at_s = self._in_view_at_s(case.kind, seed, equipped)
            others = dict(zip(before.names, reversed(before.names), strict=True))
            warned_at_s = {
                name: max(at_s, in_view_at_s[others[name]])
                for name, at_s in warned_at_s.items()
                if others[name] in in_view_at_s
            }
        for name, at_s in sorted(warned_at_s.items(), key=itemgetter(1)):
            pair.receive_warning(name, at_s)
        return self._run_with_warnings(case, seed, before, warned_at_s)

    def _in_view_at_s(
        self, kind: TrafficEventKind, seed: int, equipped: set[str]
    ) -> dict[str, float]:
        """When cars with a radio have first had each car in view for `_IN_VIEW_S`.

        Those with a radio are known from the beginning.
        """
        of = self.event(kind, seed)
        begin_s, ticks = self._begin_s(of.event), Counter[str]()
        known_at_s = dict.fromkeys(equipped, begin_s)
        sees_all = self._settings.world.model_copy(update={"detection": 1.0})
        sensor = RangingSensor(sees_all, of.scene.blocked, np.random.default_rng(seed))

        def watch(traffic: DisturbedTraffic, now: float) -> None:
            cars = traffic.cars_at(now)
            in_view = {
                name
                for own in sorted(equipped.intersection(cars.names))
                for name, _ in sensor.detections(cars.names.index(own), cars, hash, now)
            }
            ticks.update(in_view)
            for name in in_view:
                if ticks[name] * TICK_S >= _IN_VIEW_S:
                    known_at_s.setdefault(name, now)

        self._continue(self._traffic(of, seed), of.event, begin_s, watch)
        return known_at_s

    def _observed_at_s(self, kind: TrafficEventKind, seed: int, before: Crash) -> float | None:
        """When an attentive observer knows of the crash `before`; `None` if it comes as that."""
        of = self.event(kind, seed)
        event, name = of.event, of.recording.drives[of.event.car].name
        must_yield = kind is TrafficEventKind.RED_LIGHT and name in before.names
        observer = AttentiveObserver(before.names, name if must_yield else None, event.sets_off)

        def watch(traffic: DisturbedTraffic, now: float) -> None:
            if now >= event.at_s:
                observer.receive_cars(traffic.cars_at(now))

        self._continue(self._traffic(of, seed), event, self._begin_s(event), watch)
        return observer.known_at_s

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
            tracks_sensed=self._settings.brake_request is not None,
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
            radio=LossyReach(settings.reach_m, case.loss, np.random.default_rng([seed, 5])),
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
