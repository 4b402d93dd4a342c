"""Plate cameras and LCCA of an MVS study's cars: who follows whom, and who is warned.

Each car with a radio has the rig's camera model and the LCCA of `onboard`, as in `lcca-chain`. All
cars have plates. Messages reach the radios in range, and do not
load the channel of the BSMs. Houses hide no plates: only who drives the same way is read.
"""

import heapq
import math
from collections import defaultdict, deque
from collections.abc import Set
from functools import partial
from itertools import compress, count

import numpy as np

from onboard.lcca.settings import LccaSettings
from onboard.messages.lcca import CarId, LccaMessage
from onboard.observations import HardBrake, Lead, Speed
from onboard.vehicle.lcca_application import LccaApplication
from sim_rig.cars.camera_view import FPS, SIGHT_M
from sim_rig.rendering.plate_texts import text_of
from sim_rig.rendering.scene import SceneCar
from sim_rig.roads.cars import Array, Cars, Traffic
from sim_rig.scenario.sensor_settings import LensSettings
from sim_rig.studies.lcca.platoon_sight import ClearView, MeasuredSight
from sim_rig.studies.lcca.study_lcca import (
    GroupWarning,
    car_id_of,
    handle_timers,
    study_lcca,
    take_warnings,
)
from sim_rig.studies.mvs.sampled_bus import TICK_S
from sim_rig.studies.radio.lossy_reach import LossyReach

FORMING_S = 4.0
"""Time before MVS begins in which cars drive behind each other and warning groups form."""
_STEP_S = 0.01
_TRANSMISSION_S = 0.002


class LccaFleet:
    """LCCA of all cars with a radio."""

    def __init__(
        self,
        equipped: Set[str],
        lens: LensSettings,
        settings: LccaSettings,
        *,
        radio: LossyReach,
        speed_step_m_s: float,
        seed: int,
    ) -> None:
        """Start without cars.

        Args:
            equipped: names of the cars with a radio.
            lens: of their plate cameras.
            settings: of the warning groups.
            radio: of all of them.
            speed_step_m_s: resolution of the speeds on their buses.
            seed: of plates and cameras.
        """
        self._equipped = equipped
        self._lens = lens
        self._parameters = settings.parameters()
        self._radio = radio
        self._speed_step_m_s = speed_step_m_s
        self._rng = np.random.default_rng([seed, 4])
        self._cars_seen: Cars | None = None
        self._plates: defaultdict[str, str] = defaultdict(self._plate)
        self._with_lcca: dict[str, _LccaCar] = {}
        self._names: dict[CarId, str] = {}
        self._positions_m: dict[str, Array] = {}
        self._brakes: list[tuple[float, int, str, HardBrake]] = []
        self._in_transmission: deque[tuple[float, LccaMessage, list[str]]] = deque()
        self._order = count()
        self._reports: defaultdict[str, list[tuple[float, Lead | GroupWarning]]] = defaultdict(list)

    def form(self, traffic: Traffic, begin_s: float) -> None:
        """Let the cars drive until `begin_s`, as `traffic` has them, so that groups form."""
        for tick in range(round(min(FORMING_S, begin_s) / TICK_S), 0, -1):
            at_s = begin_s - tick * TICK_S
            self.drive(traffic.cars_at(at_s), at_s + TICK_S)
        self._reports.clear()

    def receive_hard_brake(self, name: str, brake: HardBrake) -> None:
        """Take what a car's own bus shows of its braking, before `drive` gets to that time."""
        heapq.heappush(self._brakes, (brake.stamp_s, next(self._order), name, brake))

    def drive(self, cars: Cars, until_s: float) -> None:
        """Let time pass while the cars move on from what `cars` says of them."""
        self._cars_seen = cars
        self._join_and_leave(cars)
        for name, car in self._with_lcca.items():
            at = cars.names.index(name)
            self._positions_m[name] = cars.middle_m[at]
            step_m_s = self._speed_step_m_s
            speed_m_s = round(float(cars.speed_m_s[at]) / step_m_s) * step_m_s
            car.speed = Speed(cars.at_s, speed_m_s, step_m_s, "study")
            car.lcca.receive_speed(car.speed, cars.at_s)
        self._receive_speeds_on_air(cars.at_s)
        for step in range(1, round((until_s - cars.at_s) / _STEP_S) + 1):
            self._step(cars.at_s + step * _STEP_S)

    def take_reports(self, name: str) -> list[tuple[float, Lead | GroupWarning]]:
        """Return what a car's camera and warning group have said since the last call, and when."""
        return self._reports.pop(name, [])

    def name_of(self, car_id: CarId) -> str:
        """The car that sends under this ID."""
        return self._names[car_id]

    def lead_of(self, name: str) -> str | None:
        """The car that a car with a radio takes to be ahead of it, if it has a radio too."""
        car_id = self._with_lcca[name].sight.lead_id
        return None if car_id is None else self._names.get(car_id)

    def _join_and_leave(self, cars: Cars) -> None:
        present = {name for name in cars.names if name in self._equipped}
        for name in self._with_lcca.keys() - present:
            del self._with_lcca[name], self._positions_m[name]
        for name in sorted(present - self._with_lcca.keys()):
            car_id = car_id_of(self._plates[name])
            self._names[car_id] = name
            phase_s = cars.at_s + float(self._rng.uniform(0.0, 1.0 / FPS))
            lcca = study_lcca(self._plates[name], car_id[:4], self._parameters, self._rng)
            view = ClearView(partial(self._seen_by, name))
            sight = MeasuredSight(lcca, view, self._lens, phase_s, self._rng)
            self._with_lcca[name] = _LccaCar(car_id[:4], lcca, sight)

    def _seen_by(self, name: str, at_s: float) -> list[tuple[str, SceneCar]]:
        """The scene in front of a car's camera, the nearest car first."""
        assert self._cars_seen is not None  # noqa: S101 (cameras look while cars drive)
        cars = self._cars_seen.moved_on(at_s - self._cars_seen.at_s)
        own, ahead = cars.names.index(name), cars.ahead
        rears_m = cars.middle_m - ahead * cars.length_m[:, None] / 2.0
        away_m = rears_m - (cars.middle_m[own] + ahead[own] * cars.length_m[own] / 2.0)
        ahead_m = away_m @ ahead[own]
        right_m = away_m @ np.array([ahead[own, 1], -ahead[own, 0]])
        in_sight = np.flatnonzero((ahead_m > 0.5) & (ahead_m < SIGHT_M))
        return [
            (
                cars.names[at],
                SceneCar(
                    float(ahead_m[at]),
                    lateral_m=float(right_m[at]),
                    heading_rad=math.remainder(
                        cars.heading_rad[own] - cars.heading_rad[at], math.tau
                    ),
                    width_m=float(cars.width_m[at]),
                    length_m=float(cars.length_m[at]),
                    plate=self._plates[cars.names[at]],
                ),
            )
            for at in in_sight[np.argsort(ahead_m[in_sight])].tolist()
        ]

    def _plate(self) -> str:
        return text_of("LL###LL", self._rng)

    def _step(self, now: float) -> None:
        while self._in_transmission and self._in_transmission[0][0] <= now:
            _, message, receivers = self._in_transmission.popleft()
            for name in receivers:
                if (receiver := self._with_lcca.get(name)) is not None:
                    receiver.lcca.receive_message(message, None, now, now)
        while self._brakes and self._brakes[0][0] <= now:
            *_, name, brake = heapq.heappop(self._brakes)
            if (braking := self._with_lcca.get(name)) is not None:
                braking.lcca.receive_hard_brake(brake, now)
        for name, car in self._with_lcca.items():
            if (lead := car.look(now)) is not None:
                self._reports[name].append((now, lead))
            handle_timers(car.lcca, now)
            self._reports[name] += [(now, warning) for warning in take_warnings(car.lcca, now)]
            for message in car.lcca.messages_to_send(now):
                arrives_s = now + _TRANSMISSION_S
                self._in_transmission.append((arrives_s, message, self._reached(name)))

    def _receive_speeds_on_air(self, now: float) -> None:
        for sender, car in self._with_lcca.items():
            for name in self._reached(sender):
                self._with_lcca[name].lcca.identification.receive_speed_on_air(
                    car.temporary_id, car.temporary_id, car.speed.speed_m_s, now
                )

    def _reached(self, sender: str) -> list[str]:
        names = [name for name in self._positions_m if name != sender]
        if not names:
            return []
        away_m = np.stack([self._positions_m[name] for name in names]) - self._positions_m[sender]
        return list(compress(names, self._radio.received(np.hypot(*away_m.T))))


class _LccaCar:
    """Camera and LCCA of one car."""

    def __init__(self, temporary_id: bytes, lcca: LccaApplication, sight: MeasuredSight) -> None:
        self.temporary_id = temporary_id
        self.lcca = lcca
        self.sight = sight
        self.speed = Speed(0.0, 0.0, 0.0, "study")

    def look(self, now: float) -> Lead | None:
        """Return what an image that is due shows, which LCCA is given."""
        if self.sight.get_timer() > now:
            return None
        self.sight.look(now)
        return self.sight.lead
