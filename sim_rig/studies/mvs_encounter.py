"""One event among many cars: who is warned in time, and whether there is a crash."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from pydantic import Field

from onboard.mvs.known_car import KnownCar
from onboard.mvs.settings import MvsSettings, Selection, SensingSettings
from onboard.risk.settings import RiskSettings
from onboard.settings import Settings
from sim_rig.roads.cars import Cars
from sim_rig.roads.crashes import Crash
from sim_rig.roads.disturbed import DisturbedTraffic, ReactionSettings
from sim_rig.roads.events import Event, Events, Kind
from sim_rig.roads.paths import DrivePath
from sim_rig.roads.recording import Recording
from sim_rig.studies.mvs_fates import SAME_PLACE_M, Concerned, Fate
from sim_rig.studies.mvs_scenes import Place, Scene, Where, open_scene
from sim_rig.studies.mvs_straight_on import touched_straight_on
from sim_rig.studies.mvs_warner import Warned, Warner
from sim_rig.studies.mvs_world import TICK_S, MvsWorld, WorldSettings

_WAY_M = np.arange(0.0, 61.0, 10.0)
"""Ahead of the event's car: where it may meet somebody."""
_LATER_S = (2.0, 4.0, 6.0)
"""After the radios are on; fast cars are far away then that will be there."""


class Method(StrEnum):
    """What the cars with a radio do."""

    NONE = "none"
    """Nothing: no radio at all."""
    DSRC = "dsrc"
    """Each tells of itself (plain DSRC)."""
    OWN = "own"
    """And sees the others itself, but does not tell of them."""
    MEASUREMENTS_ONLY = "mo"
    """And tells of measurements, chosen at random."""
    RANDOM = "rs"
    """And tells of cars, chosen at random."""
    MVS = "mvs"
    """And tells of cars as the paper says."""


class EncounterSettings(Settings):
    """What is the same in all runs."""

    scene: Where = Scene.CROSSING
    warm_s: float = Field(1.2, ge=0.3, le=30.0)
    """Before the event, cars get to know each other."""
    after_s: float = Field(7.0, ge=1.0, le=30.0)
    """A crash later than this has nothing to do with the event."""
    watched_s: float = Field(5.0, ge=0.5, le=30.0)
    """So long after the event drivers may be warned."""
    near_m: float = Field(80.0, gt=0.0, le=2000.0)
    """Radios that come no nearer to the way that the event's car has ahead are left out, to save
    time."""
    straight_on_s: float = Field(10.0, gt=0.0, le=30.0)
    """The paper's alarm looks so far ahead; it says no limit."""
    reactions: ReactionSettings = ReactionSettings()
    world: WorldSettings = WorldSettings()
    risk: RiskSettings = RiskSettings()


@dataclass(frozen=True, slots=True)
class Case:
    """One run, but for its seed."""

    kind: Kind
    method: Method
    share: float
    """Of the cars that have a radio."""
    entries: int = 10
    """M."""
    loss: float = 0.0


@dataclass(slots=True)
class Outcome:
    """What happened."""

    event: Event
    crash: Crash | None = None
    fate: Fate | None = None
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
    """Of the same event, if drivers were warned by the paper's alarm (and never for nothing)."""
    straight_on_these_two: bool = False
    """Whether that is again the crash of the two without radios."""
    straight_on_before_s: float | None = None
    """How long before the crash without radios that alarm would have come."""
    straight_on_false: int = 0
    """Drivers whom it would have warned of somebody who drives on as ever, or of nobody."""
    driven_s: float = 0.0
    """By cars that could have been warned, all together."""
    messages: int = 0


Watch = Callable[[MvsWorld, DisturbedTraffic, list[tuple[str, Warned, bool]]], None]
"""Is shown each tick: the world, and who has been warned of whom, and whether rightly."""


class Encounters:
    """All that can happen in one scene; opened once in a process."""

    def __init__(self, settings: EncounterSettings) -> None:
        """Look for where things can go wrong."""
        self._settings = settings
        self._place: Place = open_scene(settings.scene)
        self._events = Events(self._place.recording, has_lights=self._place.has_lights)
        self._without_radios: dict[tuple[Kind, int], Crash | None] = {}

    @property
    def recording(self) -> Recording:
        """What is driven where nothing goes wrong."""
        return self._place.recording

    def run(
        self,
        case: Case,
        seed: int,
        watch: Watch | None = None,
        opened: Callable[[DisturbedTraffic], None] | None = None,
    ) -> Outcome:
        """Run one case; the seed alone decides on event, drivers, and the order of radios.

        `watch` is shown every tick with radios, `opened` the traffic before it drives.
        """
        event = self._event(case.kind, seed)
        traffic = DisturbedTraffic(self.recording, event, self._settings.reactions, seed)
        if opened is not None:
            opened(traffic)
        outcome = Outcome(event)
        if case.method is Method.NONE:
            outcome.crash = self._play_on(traffic, event, self._begin_s(event))
            self._without_radios[case.kind, seed] = outcome.crash
            return outcome
        before = self._crash_without_radios(case.kind, seed)
        equipped = self._equipped(case, seed, traffic.cars_at(self._begin_s(event)), event)
        concerned = None if before is None else Concerned(before, self._can_act(before, event))
        world = self._world(case, seed, traffic, equipped)
        self._with_radios(world, traffic, outcome, concerned, watch)
        outcome.crash = self._play_on(traffic, event, world.now)
        if before is not None and concerned is not None:
            outcome.fate = concerned.fate(outcome.crash, equipped)
            outcome.known_before_s, outcome.warned_before_s = concerned.before_s()
            outcome.straight_on_before_s = concerned.straight_on_before_s()
            again = self._warned_straight_on(case, seed, before, concerned)
            outcome.straight_on_crash = again
            outcome.straight_on_these_two = again is not None and concerned.are_both(again)
        return outcome

    def without_radios(self, case: Case, seed: int) -> tuple[Crash | None, bool]:
        """The crash that there is without radios, and whether nobody is there to avoid it."""
        before, event = self._crash_without_radios(case.kind, seed), self._event(case.kind, seed)
        if before is None:
            return None, True
        traffic = DisturbedTraffic(self.recording, event, self._settings.reactions, seed)
        cars = traffic.cars_at(self._begin_s(event))
        equipped = self._equipped(case, seed, cars, event)
        return before, equipped.isdisjoint(self._can_act(before, event))

    def _warned_straight_on(
        self, case: Case, seed: int, before: Crash, concerned: Concerned
    ) -> Crash | None:
        """The same event again, whose drivers the paper's alarm warns until they would crash."""
        if not concerned.straight_on_at:
            return before
        event = self._event(case.kind, seed)
        traffic = DisturbedTraffic(self.recording, event, self._settings.reactions, seed)

        def warn(now: float) -> None:
            for name, from_s in concerned.straight_on_at.items():
                if from_s <= now <= before.at_s:
                    traffic.warn(name, now)

        return self._play_on(traffic, event, self._begin_s(event), warn)

    def _can_act(self, crash: Crash, event: Event) -> tuple[str, ...]:
        """Who of a crash can do anything about it: not who brakes, it is he that is run into."""
        brakes = self.recording.drives[event.car].name if event.deceleration_m_s2 else None
        return tuple(name for name in crash.names if name != brakes)

    def _world(
        self, case: Case, seed: int, traffic: DisturbedTraffic, equipped: set[str]
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

    def _event(self, kind: Kind, seed: int) -> Event:
        return self._events.draw(kind, np.random.default_rng([seed, 0]))

    def _begin_s(self, event: Event) -> float:
        return max(round(event.at_s - self._settings.warm_s, 1), 0.0)

    def _crash_without_radios(self, kind: Kind, seed: int) -> Crash | None:
        """Of the same event and drivers; kept, since all cases of a seed ask for it."""
        if (kind, seed) not in self._without_radios:
            self.run(Case(kind, Method.NONE, 0.0), seed)
        return self._without_radios[kind, seed]

    def _play_on(
        self,
        traffic: DisturbedTraffic,
        event: Event,
        now: float,
        warn: Callable[[float], None] | None = None,
    ) -> Crash | None:
        """Let the cars drive on without radios; a crash much later is none of the event's."""
        end_s = event.at_s + self._settings.after_s
        while now < end_s and traffic.crash is None:
            now = round(now + TICK_S, 3)
            traffic.cars_at(now)
            if warn is not None:
                warn(now)
        return traffic.crash if traffic.crash and traffic.crash.at_s <= end_s else None

    def _with_radios(
        self,
        world: MvsWorld,
        traffic: DisturbedTraffic,
        outcome: Outcome,
        concerned: Concerned | None,
        watch: Watch | None,
    ) -> None:
        """Let the radios work until nothing they say matters any more."""
        settings, event = self._settings, outcome.event
        warners: dict[str, Warner] = {}
        ours, straight_on = _Alarms(settings.risk.release_s), _Alarms(settings.risk.release_s)
        while world.now < event.at_s + settings.watched_s and traffic.crash is None:
            world.tick()
            outcome.messages += len(world.sent)
            outcome.driven_s += TICK_S * len(world.cores)
            cars = traffic.cars_at(world.now)
            shown: list[tuple[str, Warned, bool]] = []
            for name, core in world.cores.items():
                at = cars.index(name)
                if at is None:
                    continue
                warner = warners.get(name)
                if warner is None:
                    warner = warners[name] = Warner(settings.risk, *_size_m(cars, at))
                own, speed = core.own_car(world.now), float(cars.speed_m_s[at])
                known = core.kinematic_info(world.now)
                of = self._touched(own, known, cars, at)
                if of is not None:
                    right = self._is_right(world, traffic, cars, name, of)
                    if right and concerned is not None:
                        concerned.receive_straight_on(name, world.now)
                    outcome.straight_on_false += straight_on.begins(name, world.now) and not right
                if concerned is not None and concerned.is_one(name):
                    places = np.array([world.place_of(name, car.state) for car in known])
                    concerned.receive_known(name, places, cars)
                told = warner.assess(own, known, speed, world.now)
                if told is None:
                    continue
                right = self._is_right(world, traffic, cars, name, told.of)
                shown.append((name, told, right))
                traffic.warn(name, world.now)
                if right and concerned is not None:
                    concerned.receive_warning(name, world.now)
                if ours.begins(name, world.now):
                    self._count(outcome, right=right, now=world.now)
            if watch is not None:
                watch(world, traffic, shown)

    def _touched(
        self, own: KnownCar | None, known: list[KnownCar], cars: Cars, at: int
    ) -> KnownCar | None:
        """Of whom the paper's alarm warns a driver."""
        risk, within_s = self._settings.risk, self._settings.straight_on_s
        if own is None or cars.speed_m_s[at] < risk.least_speed_m_s:
            return None
        return touched_straight_on(own, known, _size_m(cars, at), risk, within_s)

    def _equipped(self, case: Case, seed: int, cars: Cars, event: Event) -> set[str]:
        """More of the same cars as the share grows, of those that come near the event's way."""
        drives = self.recording.drives
        luck = np.random.default_rng([seed, 1]).random(len(drives))
        path = DrivePath(drives[event.car])
        way, _ = path.places(path.way_m(event.at_s + event.sooner_s) + _WAY_M)
        near: set[str] = set()
        for then in (cars, *(self.recording.cars_at(cars.at_s + later) for later in _LATER_S)):
            away_m = np.hypot(*(then.middle_m[:, None] - way).transpose(2, 0, 1)).min(axis=1)
            near |= {then.names[i] for i in np.flatnonzero(away_m <= self._settings.near_m)}
        return {d.name for d, mine in zip(drives, luck, strict=True) if mine < case.share} & near

    def _is_right(
        self, world: MvsWorld, traffic: DisturbedTraffic, cars: Cars, name: str, of: KnownCar
    ) -> bool:
        """Whether who is warned is the event's car, or who he is warned of drives otherwise."""
        if traffic.has_moved(name):
            return True
        away_m = np.hypot(*(cars.middle_m - world.place_of(name, of.state)).T)
        nearest = int(away_m.argmin())
        is_there = away_m[nearest] < SAME_PLACE_M
        return bool(is_there and traffic.is_disturbed(cars.names[nearest]))

    @staticmethod
    def _count(outcome: Outcome, *, right: bool, now: float) -> None:
        if not right:
            outcome.false_warnings += 1
            return
        outcome.warned += 1
        if outcome.first_warning_s is None:
            outcome.first_warning_s = round(now - outcome.event.at_s, 3)


class _Alarms:
    """Whose driver is being warned; a pause ends that."""

    def __init__(self, release_s: float) -> None:
        self._release_s = release_s
        self._until: dict[str, float] = {}

    def begins(self, name: str, now: float) -> bool:
        """A driver is warned now; whether he was not before."""
        begins = now >= self._until.get(name, -math.inf)
        self._until[name] = now + self._release_s
        return begins


def _size_m(cars: Cars, at: int) -> tuple[float, float]:
    return float(cars.length_m[at]), float(cars.width_m[at])


def _mvs(case: Case) -> MvsSettings:
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
