"""One event among many cars: who is warned in time, and whether there is a crash."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from pydantic import Field

from onboard.mvs.perceived_object import PerceivedObject
from onboard.mvs.settings import MvsSettings, Selection, SensingSettings
from onboard.risk.settings import RiskSettings
from onboard.settings import Settings
from sim_rig.roads.cars import Cars
from sim_rig.roads.crashes import Crash
from sim_rig.roads.disturbed import DisturbedTraffic
from sim_rig.roads.driver import ReactionSettings
from sim_rig.roads.events import TrafficEvent, TrafficEventKind, TrafficEvents
from sim_rig.roads.paths import DrivePath
from sim_rig.roads.recording import RecordedTraffic
from sim_rig.studies.mvs_outcomes import SAME_PLACE_M, Concerned, CrashOutcome
from sim_rig.studies.mvs_scenes import OpenScene, SceneName, Where, open_scene
from sim_rig.studies.mvs_straight_on import touched_straight_on
from sim_rig.studies.mvs_warner import Warned, Warner
from sim_rig.studies.mvs_world import TICK_S, MvsWorld, WorldSettings

_WAY_M = np.arange(0.0, 61.0, 10.0)
"""Ahead of the event's car: where it may meet somebody."""
_LATER_S = (2.0, 4.0, 6.0)
"""After the radios are on: fast cars that will be near the event are far away at first."""


class Method(StrEnum):
    """What the cars with a radio do."""

    NONE = "none"
    """Nothing: no radio at all."""
    DSRC = "dsrc"
    """Each tells of itself (plain DSRC)."""
    OWN = "own"
    """Each tells of itself, and uses its own sensors, but does not share what they see."""
    MEASUREMENTS_ONLY = "mo"
    """As `OWN`, and shares measurements, chosen at random."""
    RANDOM = "rs"
    """As `OWN`, and shares what it knows of cars, chosen at random."""
    MVS = "mvs"
    """As `OWN`, and shares what it knows of cars, chosen as the paper says."""


class EncounterSettings(Settings):
    """What is the same in all runs."""

    scene: Where = SceneName.CROSSING
    warm_s: float = Field(1.2, ge=0.3, le=30.0)
    """Before the event, cars get to know each other."""
    after_s: float = Field(7.0, ge=1.0, le=30.0)
    """A crash later than this has nothing to do with the event."""
    watched_s: float = Field(5.0, ge=0.5, le=30.0)
    """For how long after the event drivers may be warned."""
    near_m: float = Field(80.0, gt=0.0, le=2000.0)
    """Radios that never come nearer than this to the path of the event's car are left out, to save
    time."""
    straight_on_s: float = Field(10.0, gt=0.0, le=30.0)
    """How far the paper's alarm looks ahead; the paper gives no limit."""
    reactions: ReactionSettings = ReactionSettings()
    world: WorldSettings = WorldSettings()
    risk: RiskSettings = RiskSettings()


@dataclass(frozen=True, slots=True)
class EncounterCase:
    """One run, but for its seed."""

    kind: TrafficEventKind
    method: Method
    share: float
    """Of the cars that have a radio."""
    entries: int = 10
    """M."""
    loss: float = 0.0


@dataclass(slots=True)
class EncounterOutcome:
    """What happened."""

    event: TrafficEvent
    crash: Crash | None = None
    fate: CrashOutcome | None = None
    """Of the crash without radios, if there is one."""
    known_before_s: float | None = None
    """How long before that crash one of those who can act first knew the other."""
    warned_before_s: float | None = None
    """And was first warned."""
    first_warning_s: float | None = None
    """After the event, of a car that the event concerns."""
    warned: int = 0
    """Drivers warned of somebody whom the event had moved."""
    false_warnings: int = 0
    """Drivers warned of somebody who drives on as ever, or of nobody."""
    straight_on_crash: Crash | None = None
    """Of the same event, if the paper's alarm warned the drivers, and never for nothing."""
    straight_on_these_two: bool = False
    """Whether that is again the crash of the two without radios."""
    straight_on_before_s: float | None = None
    """How long before the crash without radios that alarm would have come."""
    straight_on_false: int = 0
    """Drivers whom it would have warned of somebody who drives on as ever, or of nobody."""
    driven_s: float = 0.0
    """By cars that could have been warned, all together."""
    messages: int = 0


Shown = tuple[str, Warned, bool]
"""Who has been warned, of whom, and whether rightly."""

Watch = Callable[[MvsWorld, DisturbedTraffic, list[Shown]], None]
"""Called after each tick with radios."""

Played = Callable[[DisturbedTraffic, float], None]
"""Called after each tick without radios, with the time."""


class Encounters:
    """All that can happen in one scene; opened once in a process."""

    def __init__(self, settings: EncounterSettings) -> None:
        """Look for where things can go wrong."""
        self._settings = settings
        self._place: OpenScene = open_scene(settings.scene)
        self._events = TrafficEvents(self._place.recording, has_lights=self._place.has_lights)
        self._without_radios: dict[tuple[TrafficEventKind, int], Crash | None] = {}

    @property
    def recording(self) -> RecordedTraffic:
        """What is driven where nothing goes wrong."""
        return self._place.recording

    def run(
        self,
        case: EncounterCase,
        seed: int,
        watch: Watch | None = None,
        played: Played | None = None,
    ) -> EncounterOutcome:
        """Run one case; the seed alone decides on event, drivers, and the order of radios.

        `watch` is shown every tick with radios, `played` those without, which come after.
        """
        event = self._event(case.kind, seed)
        traffic = DisturbedTraffic(self.recording, event, self._settings.reactions, seed)
        outcome = EncounterOutcome(event)
        if case.method is Method.NONE:
            outcome.crash = self._play_on(traffic, event, self._begin_s(event), played)
            self._without_radios[case.kind, seed] = outcome.crash
            return outcome
        before = self._crash_without_radios(case.kind, seed)
        equipped = self._equipped(case, seed, traffic.cars_at(self._begin_s(event)), event)
        concerned = None if before is None else Concerned(before, self._can_act(before, event))
        world = self._world(case, seed, traffic, equipped)
        drivers = _Drivers(self._settings, world, traffic, outcome, concerned)
        while world.now < event.at_s + self._settings.watched_s and traffic.crash is None:
            shown = drivers.tick()
            if watch is not None:
                watch(world, traffic, shown)
        outcome.crash = self._play_on(traffic, event, world.now, played)
        if before is not None and concerned is not None:
            outcome.fate = concerned.fate(outcome.crash, equipped)
            outcome.known_before_s, outcome.warned_before_s = concerned.before_s()
            outcome.straight_on_before_s = concerned.straight_on_before_s()
            again = self._warned_straight_on(case, seed, before, concerned)
            outcome.straight_on_crash = again
            outcome.straight_on_these_two = again is not None and concerned.are_both(again)
        return outcome

    def without_radios(self, case: EncounterCase, seed: int) -> tuple[Crash | None, bool]:
        """The crash without radios, and whether nobody with a radio could avoid it."""
        before, event = self._crash_without_radios(case.kind, seed), self._event(case.kind, seed)
        if before is None:
            return None, True
        traffic = DisturbedTraffic(self.recording, event, self._settings.reactions, seed)
        cars = traffic.cars_at(self._begin_s(event))
        equipped = self._equipped(case, seed, cars, event)
        return before, equipped.isdisjoint(self._can_act(before, event))

    def _warned_straight_on(
        self, case: EncounterCase, seed: int, before: Crash, concerned: Concerned
    ) -> Crash | None:
        """The same event again, with drivers warned by the paper's alarm until they would crash."""
        if not concerned.straight_on_at:
            return before
        event = self._event(case.kind, seed)
        traffic = DisturbedTraffic(self.recording, event, self._settings.reactions, seed)

        def warn(traffic: DisturbedTraffic, now: float) -> None:
            for name, from_s in concerned.straight_on_at.items():
                if from_s <= now <= before.at_s:
                    traffic.warn(name, now)

        return self._play_on(traffic, event, self._begin_s(event), warn)

    def _can_act(self, crash: Crash, event: TrafficEvent) -> tuple[str, ...]:
        """The cars of a crash whose drivers can avoid it: not one that brakes and is run into."""
        brakes = self.recording.drives[event.car].name if event.deceleration_m_s2 else None
        return tuple(name for name in crash.names if name != brakes)

    def _world(
        self, case: EncounterCase, seed: int, traffic: DisturbedTraffic, equipped: set[str]
    ) -> MvsWorld:
        senses = case.method is not Method.DSRC
        world = MvsWorld(
            traffic,
            equipped,
            self._settings.world.model_copy(update={"senses": senses, "loss": case.loss}),
            _mvs(case),
            seed,
            blocked=self._place.blocked,
        )
        world.now = self._begin_s(self._event(case.kind, seed))
        return world

    def _event(self, kind: TrafficEventKind, seed: int) -> TrafficEvent:
        return self._events.draw(kind, np.random.default_rng([seed, 0]))

    def _begin_s(self, event: TrafficEvent) -> float:
        return max(round(event.at_s - self._settings.warm_s, 1), 0.0)

    def _crash_without_radios(self, kind: TrafficEventKind, seed: int) -> Crash | None:
        """The crash of the same event and drivers; kept, since all cases of a seed ask for it."""
        if (kind, seed) not in self._without_radios:
            self.run(EncounterCase(kind, Method.NONE, 0.0), seed)
        return self._without_radios[kind, seed]

    def _play_on(
        self,
        traffic: DisturbedTraffic,
        event: TrafficEvent,
        now: float,
        played: Played | None = None,
    ) -> Crash | None:
        """Let the cars drive on without radios. A crash after `after_s` is not counted."""
        end_s = event.at_s + self._settings.after_s
        while now < end_s and traffic.crash is None:
            now = round(now + TICK_S, 3)
            traffic.cars_at(now)
            if played is not None:
                played(traffic, now)
        return traffic.crash if traffic.crash and traffic.crash.at_s <= end_s else None

    def _equipped(
        self, case: EncounterCase, seed: int, cars: Cars, event: TrafficEvent
    ) -> set[str]:
        """The cars with a radio near the path of the event's car; a larger share adds to them."""
        drives = self.recording.drives
        luck = np.random.default_rng([seed, 1]).random(len(drives))
        path = DrivePath(drives[event.car])
        way, _ = path.places(path.way_m(event.at_s + event.sooner_s) + _WAY_M)
        near: set[str] = set()
        for then in (cars, *(self.recording.cars_at(cars.at_s + later) for later in _LATER_S)):
            away_m = np.hypot(*(then.middle_m[:, None] - way).transpose(2, 0, 1)).min(axis=1)
            near |= {then.names[i] for i in np.flatnonzero(away_m <= self._settings.near_m)}
        return {d.name for d, mine in zip(drives, luck, strict=True) if mine < case.share} & near


class _Drivers:
    """The drivers with a radio: who of them is warned, tick by tick, and whether rightly."""

    def __init__(
        self,
        settings: EncounterSettings,
        world: MvsWorld,
        traffic: DisturbedTraffic,
        outcome: EncounterOutcome,
        concerned: Concerned | None,
    ) -> None:
        """Note what happens in `outcome` and, if there is a crash to avoid, in `concerned`."""
        self._settings = settings
        self._world = world
        self._traffic = traffic
        self._outcome = outcome
        self._concerned = concerned
        self._warners: dict[str, Warner] = {}
        self._ours = _Alarms(settings.risk.release_s)
        self._straight_on = _Alarms(settings.risk.release_s)

    def tick(self) -> list[Shown]:
        """Let all drive and talk for a tick; returns who is warned."""
        world = self._world
        world.tick()
        self._outcome.messages += len(world.sent)
        self._outcome.driven_s += TICK_S * len(world.cores)
        cars = self._traffic.cars_at(world.now)
        shown: list[Shown] = []
        for name, core in world.cores.items():
            at = cars.index(name)
            if at is None:
                continue
            own, known = core.host_vehicle(world.now), core.kinematic_info(world.now)
            self._judge_straight_on(own, known, cars, at)
            if self._concerned is not None and self._concerned.is_one(name):
                places = np.array([world.place_of(name, car.state) for car in known])
                self._concerned.receive_known(name, places, cars)
            told = self._warner(cars, at).assess(own, known, float(cars.speed_m_s[at]), world.now)
            if told is not None:
                right = self._is_right(cars, name, told.of)
                shown.append((name, told, right))
                self._warn(name, right=right)
        return shown

    def _warner(self, cars: Cars, at: int) -> Warner:
        name = cars.names[at]
        if name not in self._warners:
            self._warners[name] = Warner(self._settings.risk, *_size_m(cars, at))
        return self._warners[name]

    def _warn(self, name: str, *, right: bool) -> None:
        now, outcome = self._world.now, self._outcome
        self._traffic.warn(name, now)
        if right and self._concerned is not None:
            self._concerned.receive_warning(name, now)
        if not self._ours.begins(name, now):
            return
        if not right:
            outcome.false_warnings += 1
            return
        outcome.warned += 1
        if outcome.first_warning_s is None:
            outcome.first_warning_s = round(now - outcome.event.at_s, 3)

    def _judge_straight_on(
        self, own: PerceivedObject | None, known: list[PerceivedObject], cars: Cars, at: int
    ) -> None:
        """Note whether the paper's alarm would warn this driver, and whether rightly."""
        risk, within_s = self._settings.risk, self._settings.straight_on_s
        if own is None or cars.speed_m_s[at] < risk.least_speed_m_s:
            return
        of = touched_straight_on(own, known, _size_m(cars, at), risk, within_s)
        if of is None:
            return
        name, now = cars.names[at], self._world.now
        right = self._is_right(cars, name, of)
        if right and self._concerned is not None:
            self._concerned.receive_straight_on(name, now)
        self._outcome.straight_on_false += self._straight_on.begins(name, now) and not right

    def _is_right(self, cars: Cars, name: str, of: PerceivedObject) -> bool:
        """Whether the event has changed how the warned car drives, or the one it is warned of."""
        if self._traffic.has_moved(name):
            return True
        away_m = np.hypot(*(cars.middle_m - self._world.place_of(name, of.state)).T)
        nearest = int(away_m.argmin())
        is_there = away_m[nearest] < SAME_PLACE_M
        return bool(is_there and self._traffic.is_disturbed(cars.names[nearest]))


class _Alarms:
    """Drivers who are being warned, until there is no warning for `release_s`."""

    def __init__(self, release_s: float) -> None:
        self._release_s = release_s
        self._until: dict[str, float] = {}

    def begins(self, name: str, now: float) -> bool:
        """Note that a driver is warned now; returns whether that is a new warning."""
        begins = now >= self._until.get(name, -math.inf)
        self._until[name] = now + self._release_s
        return begins


def _size_m(cars: Cars, at: int) -> tuple[float, float]:
    return float(cars.length_m[at]), float(cars.width_m[at])


def _mvs(case: EncounterCase) -> MvsSettings:
    selections = {
        Method.MEASUREMENTS_ONLY: Selection.MEASUREMENTS_ONLY,
        Method.RANDOM: Selection.RANDOM,
    }
    return MvsSettings(
        selection=selections.get(case.method, Selection.MVS),
        most_entries=0 if case.method in {Method.DSRC, Method.OWN} else case.entries,
        # The study's sensors range to the middle of a car.
        sensing=SensingSettings(face_to_centre_m=0.0, face_to_centre_sigma_m=0.0),
    )
