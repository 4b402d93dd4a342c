"""The cars with a radio in one event: who is warned in each tick, and whether rightly."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from onboard.brake_request.settings import BrakeRequestSettings
from onboard.observations import HardBrake, Lead
from onboard.risk.alarm import RELEASE_S, Cause
from onboard.risk.settings import RiskSettings
from onboard.tracking.perceived_object import PerceivedObject
from sim_rig.cars.brake_controller import BRAKE_DELAY_S
from sim_rig.roads.cars import Array, Cars
from sim_rig.roads.disturbed import DisturbedTraffic
from sim_rig.studies.mvs.driver_warning import DriverWarning, WarningModel
from sim_rig.studies.mvs.lcca import LccaFleet
from sim_rig.studies.mvs.outcomes import SAME_POSITION_M, CrashPair, EncounterOutcome
from sim_rig.studies.mvs.paper_alarm import paper_alarm
from sim_rig.studies.mvs.sampled_bus import TICK_S
from sim_rig.studies.mvs.world import MvsWorld, WorldCar


class IssuedWarning(NamedTuple):
    """A warning of a driver."""

    warned: str
    """Name of the car."""
    cause: Cause
    of: str
    """Name of the perceived object, or of the vehicle of the warning group; empty for the lead
    of the camera."""
    position_m: Array
    """(2) of that vehicle, as the warned car takes it."""
    right: bool
    """Whether the event has changed the motion of one of the two, or they crash without radios."""


class EquippedCars:
    """The cars with a radio: which of them is warned in each tick, and whether rightly."""

    def __init__(
        self,
        world: MvsWorld,
        traffic: DisturbedTraffic,
        outcome: EncounterOutcome,
        pair: CrashPair | None,
        lcca: LccaFleet | None,
        *,
        risk: RiskSettings,
        brake_request: BrakeRequestSettings | None,
        paper_alarm_horizon_s: float,
    ) -> None:
        """Prepare a run.

        Args:
            world: cars with a radio, and their cores.
            traffic: all cars, with the event.
            outcome: result, which is updated in each tick.
            pair: the cars of the crash without radios; None if there is none.
            lcca: of the cars; None if they have none.
            risk: thresholds of the alarms.
            brake_request: when cars request to brake; never if None.
            paper_alarm_horizon_s: of the paper's alarm.
        """
        self._risk = risk
        self._brake_request = brake_request
        self._paper_alarm_horizon_s = paper_alarm_horizon_s
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
        self._outcome.driven_s += TICK_S * len(world.cars)
        cars = self._traffic.cars_at(world.now)
        warnings: list[IssuedWarning] = []
        for name, car in world.cars.items():
            at = cars.index(name)
            if at is not None:
                warnings += self._judge(car, cars, at)
        return warnings

    def _judge(self, car: WorldCar, cars: Cars, at: int) -> Iterator[IssuedWarning]:
        """Let the car at index `at` judge its situation; yields its active warnings."""
        world, mvs, name = self._world, car.sharing.mvs, cars.names[at]
        mvs.update(world.now)
        own, objects = mvs.host_vehicle(world.now), mvs.kinematic_info(world.now)
        self._evaluate_paper_alarm(own, objects, cars, at)
        if self._pair is not None and self._pair.can_act(name):
            positions_m = np.array([world.world_position_m(name, each.state) for each in objects])
            self._pair.receive_perceived(name, positions_m, cars)
        model = self._model(cars, at)
        for observation in car.observations:
            model.receive_observation(observation, world.now)
        for message in car.received:
            model.receive_bsm(message, world.now)
        self._hand_over_reports(name, model)
        heading, sensed = mvs.heading(world.now), mvs.sensed_objects(world.now)
        active = model.assess(own, objects, world.now, heading, sensed)
        for request in model.take_brake_requests():
            begin_s = request.stamp_s + BRAKE_DELAY_S
            until_s = begin_s + request.valid_s
            self._traffic.brake(name, begin_s, until_s, request.deceleration_m_s2)
        for warning in active:
            issued = self._issued(cars, at, warning)
            self._warn(name, right=issued.right)
            yield issued

    def _run_lcca(self, before: Cars) -> None:
        """Run the warning groups during the tick that began with the cars as in `before`."""
        if self._lcca is not None:
            for name, car in self._world.cars.items():
                for observation in car.observations:
                    if isinstance(observation, HardBrake):
                        self._lcca.receive_hard_brake(name, observation)
            self._lcca.drive(before, self._world.now)

    def _hand_over_reports(self, name: str, model: WarningModel) -> None:
        """Let the alarms of a car have what its plate camera and its warning group say."""
        for now, report in [] if self._lcca is None else self._lcca.take_reports(name):
            if isinstance(report, Lead):
                model.receive_observation(report, now)
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
            self._models[name] = WarningModel(self._risk, *_size_m(cars, at), self._brake_request)
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
        if own is None or cars.speed_m_s[at] < self._risk.least_speed_m_s:
            return
        target = paper_alarm(own, objects, _size_m(cars, at), self._paper_alarm_horizon_s)
        if target is None:
            return
        name, now = cars.names[at], self._world.now
        right = self._is_right(cars, name, self._world.world_position_m(name, target.state))
        if right and self._pair is not None:
            self._pair.receive_paper_alarm(name, now)
        self._outcome.paper_alarm_false += self._paper_alarm.refresh(name, now) and not right

    def _is_right(self, cars: Cars, name: str, target_m: Array) -> bool:
        """Whether the event has changed the motion of a warned car or of the one at `target_m`.

        Or they are the two that crash without radios: who runs a light is seen to drive too fast
        before the event begins.
        """
        if self._traffic.has_moved(name):
            return True
        away_m = np.hypot(*(cars.middle_m - target_m).T)
        nearest = int(away_m.argmin())
        if away_m[nearest] >= SAME_POSITION_M:
            return False
        other = cars.names[nearest]
        return self._traffic.is_disturbed(other) or (
            self._pair is not None and self._pair.are(name, other)
        )


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
