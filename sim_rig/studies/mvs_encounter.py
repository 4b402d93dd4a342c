"""One event among many cars: who is warned in time, and whether there is a crash."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from pydantic import Field

from onboard.mvs.settings import MvsSettings, Selection, SensingSettings
from onboard.risk.settings import RiskSettings
from onboard.settings import Settings
from sim_rig.roads.cars import Cars
from sim_rig.roads.crashes import Crash
from sim_rig.roads.disturbed import DisturbedTraffic, ReactionSettings
from sim_rig.roads.events import Event, Events, Kind
from sim_rig.roads.recording import Recording
from sim_rig.studies.mvs_scenes import Place, Scene, open_scene
from sim_rig.studies.mvs_warner import Warned, Warner
from sim_rig.studies.mvs_world import TICK_S, MvsWorld, WorldSettings

_GHOST_M = 4.0
"""Nobody is within this of what was warned of."""
_SHOWN_S = 0.1


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

    scene: Scene = Scene.CROSSING
    warm_s: float = Field(1.2, ge=0.3, le=30.0)
    """Before the event, cars get to know each other."""
    after_s: float = Field(7.0, ge=1.0, le=30.0)
    """A crash later than this has nothing to do with the event."""
    watched_s: float = Field(5.0, ge=0.5, le=30.0)
    """So long after the event drivers may be warned."""
    near_m: float = Field(150.0, gt=0.0, le=2000.0)
    """Radios farther from the event than this are left out, to save time."""
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
    first_warning_s: float | None = None
    """After the event, of a car that the event concerns."""
    warned: int = 0
    """Drivers warned of somebody whom the event had moved."""
    false_warnings: int = 0
    """Drivers warned of somebody who drives on as ever, or of nobody."""
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
        settings = self._settings
        event = self._events.draw(case.kind, np.random.default_rng([seed, 0]))
        traffic = DisturbedTraffic(self.recording, event, settings.reactions, seed)
        outcome = Outcome(event)
        if opened is not None:
            opened(traffic)
        begin_s = max(round(event.at_s - settings.warm_s, 1), 0.0)
        end_s = event.at_s + settings.after_s
        now = begin_s
        if case.method is not Method.NONE:
            now = self._with_radios(case, seed, traffic, outcome, watch)
        while now < end_s and traffic.crash is None:
            now = round(now + TICK_S, 3)
            traffic.cars_at(now)
        outcome.crash = traffic.crash if traffic.crash and traffic.crash.at_s <= end_s else None
        return outcome

    def _with_radios(
        self,
        case: Case,
        seed: int,
        traffic: DisturbedTraffic,
        outcome: Outcome,
        watch: Watch | None,
    ) -> float:
        """Let the radios work until nothing they say matters any more; returns when that is."""
        settings, event = self._settings, outcome.event
        begin_s = max(round(event.at_s - settings.warm_s, 1), 0.0)
        world = MvsWorld(
            traffic,
            self._equipped(case, seed, traffic.cars_at(begin_s), event),
            settings.world.model_copy(
                update={"senses": case.method is not Method.DSRC, "loss": case.loss}
            ),
            _mvs(case),
            seed,
            blocked=self._place.blocked,
        )
        world.now = begin_s
        warners: dict[str, Warner] = {}
        warned_until: dict[str, float] = {}
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
                    size = float(cars.length_m[at]), float(cars.width_m[at])
                    warner = warners[name] = Warner(settings.risk, *size)
                own, speed = core.own_car(world.now), float(cars.speed_m_s[at])
                told = warner.assess(own, core.kinematic_info(world.now), speed, world.now)
                if told is None:
                    continue
                right = self._is_right(world, traffic, cars, name, told)
                shown.append((name, told, right))
                traffic.warn(name, world.now)
                if world.now >= warned_until.get(name, -math.inf):
                    self._count(outcome, right=right, now=world.now)
                warned_until[name] = world.now + settings.risk.release_s
            if watch is not None:
                watch(world, traffic, shown)
        return world.now

    def _equipped(self, case: Case, seed: int, cars: Cars, event: Event) -> set[str]:
        """More of the same cars as the share grows; none that is far from the event."""
        luck = np.random.default_rng([seed, 1]).random(len(self.recording.drives))
        drives = self.recording.drives
        equipped = {d.name for d, mine in zip(drives, luck, strict=True) if mine < case.share}
        at_s = event.at_s + event.sooner_s
        step = max(round(at_s / TICK_S) - drives[event.car].first, 0)
        middle_m = drives[event.car].middle_m[min(step, len(drives[event.car]) - 1)]
        far = np.hypot(*(cars.middle_m - middle_m).T) > self._settings.near_m
        return equipped - {cars.names[i] for i in np.flatnonzero(far)}

    def _is_right(
        self, world: MvsWorld, traffic: DisturbedTraffic, cars: Cars, name: str, told: Warned
    ) -> bool:
        """Whether who is warned, or who he is warned of, no longer drives as ever."""
        away_m = np.hypot(*(cars.middle_m - world.place_of(name, told.of.state)).T)
        nearest = int(away_m.argmin())
        is_there = away_m[nearest] < _GHOST_M
        return bool(is_there and traffic.is_disturbed(cars.names[nearest]))

    @staticmethod
    def _count(outcome: Outcome, *, right: bool, now: float) -> None:
        if not right:
            outcome.false_warnings += 1
            return
        outcome.warned += 1
        if outcome.first_warning_s is None:
            outcome.first_warning_s = round(now - outcome.event.at_s, 3)


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
