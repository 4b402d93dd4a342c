"""Chain collisions in a platoon, with and without LCCA, and the channel load of its warnings.

The first car brakes hard. Every driver brakes one reaction time after its lead, or after a
warning. Whether a car then hits its lead follows from the closed form that channel access uses
(`onboard/access/rear_end.py`). The warnings come from the cores of `onboard`. Which car is ahead is
found out by the camera model and these cores (`platoon_sight.py`), or assumed to be known; a car
without a radio is seen by the camera behind it, but neither answers nor warns.
"""

import math
from dataclasses import dataclass
from itertools import count
from typing import Annotated

import numpy as np
from pydantic import Field

from onboard.access.rear_end import tolerable_lag_s
from onboard.kinematics.units import KM_H
from onboard.lcca.events import WarningRaised
from onboard.lcca.settings import LccaSettings
from onboard.messages.lcca import Warn
from onboard.observations import HardBrake, Speed
from onboard.settings import Settings
from onboard.vehicle.lcca_application import LccaApplication
from sim_rig.cars.camera_view import FPS
from sim_rig.rendering.plate_texts import text_of
from sim_rig.rendering.scene import SceneCar
from sim_rig.scenario.radio_settings import CsmaSettings, SidelinkSettings
from sim_rig.scenario.setting_types import Positive, Several, Share, Span
from sim_rig.studies.campaigns.study import Case
from sim_rig.studies.lcca.platoon_cautions import Cautions, PlatoonCautions
from sim_rig.studies.lcca.platoon_channel import CHANNEL_STEP_S, LossyChannel, PlatoonChannel
from sim_rig.studies.lcca.platoon_sight import (
    LENSES,
    AssumedSight,
    ClearView,
    MeasuredSight,
    Sight,
)
from sim_rig.studies.lcca.study_lcca import (
    car_id_of,
    handle_timers,
    study_lcca,
    take_warnings,
    timer_of,
)
from sim_rig.studies.radio.lossy_reach import LossyReach

_STEP_S = 0.01
_SPEED_INTERVAL_S = 0.1
_LENGTH_M = 4.5
_SPEEDOMETER = (1.004, 1.012)
"""What OBD says of the true speed: 0.4 to 1.2 % more in recorded drives, in whole km/h."""


class ChainSettings(Settings):
    """One campaign; a run is one platoon under one share of radios."""

    seed: int = Field(1, ge=0)
    """Of the first platoons; each further one of a length has the next."""
    runs: int = Field(200, ge=1)
    """Platoons of each length."""
    cars: Several[Annotated[int, Field(ge=2, le=999)]] = (5, 10, 20)
    """Numbers of cars in a platoon."""
    shares: Several[Share] = (0.0, 0.25, 0.5, 0.75, 1.0)
    """Shares of the cars with a radio."""
    sights: Several[Sight] = ("unlimited", "recommended", "rig")
    """How cars know their lead: `unlimited`; by the camera model with the `recommended` lens or
    the one of the `rig`; or up to so many metres."""
    cautions: Several[Cautions] = ("off",)
    """Whether drivers are cautioned of hard braking ahead, beside the warnings of their groups, and
    how cars know that it is ahead: `off`; by `motion`; by positions, too, with this sigma in m; or
    `known`, the ceiling."""
    reaction_medians_s: Several[Positive] = (1.0, 1.5)
    """Medians of the log-normal reaction time without a warning."""
    reaction_sigma: float = Field(0.35, ge=0.0, le=1.5)
    """Standard deviation of the logarithm of that time."""
    warned_median_s: float = Field(0.9, gt=0.0, le=5.0)
    """Median of the log-normal reaction time after a warning."""
    warned_sigma: float = Field(0.3, ge=0.0, le=1.5)
    """Standard deviation of the logarithm of that time."""
    speed_m_s: Span[Positive] = (22.0, 32.0)
    """Range of the speed of a platoon; it is uniform."""
    headway_s: Span[Positive] = (0.8, 1.8)
    """Bumper to bumper; all gaps are below the safety distance of LCCA."""
    deceleration_m_s2: Span[Positive] = (5.0, 8.0)
    """Range of the deceleration of a car; it is uniform."""
    detection_s: float = Field(0.3, ge=0.0, le=2.0)
    """Time from the start of braking to its detection by the car itself."""
    reach_m: float = Field(300.0, gt=0.0)
    """Range of a radio."""
    loss: float = Field(0.1, ge=0.0, lt=1.0)
    """Probability that a receiver in range loses a message."""
    csma: CsmaSettings | None = None
    """The 802.11p channel; replaces `reach_m` and `loss`, and all radios send BSMs too."""
    sidelink: SidelinkSettings | None = None
    """C-V2X, where `csma` is not given."""
    background_traffic: int = Field(0, ge=0, le=1000)
    """With the channel: cars that only send BSMs, up to half a kilometre before and behind."""
    forming_s: float = Field(4.0, ge=1.0, le=30.0)
    """Time before the braking in which the warning groups form."""
    lcca: LccaSettings = LccaSettings()
    """The warning group."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainCase(Case):
    """One platoon."""

    reaction_median_s: float
    cars: int
    sight: Sight
    """How they know their lead."""
    cautions: Cautions
    share: float
    """Of the cars with a radio."""


class Platoon:
    """Cars in one lane, number 0 first. The first car brakes at time 0."""

    def __init__(self, settings: ChainSettings, case: ChainCase) -> None:
        """Cars and drivers depend on the seed alone, not on the share of radios."""
        cars, seed = case.cars, settings.seed + case.repetition
        self._settings = settings
        rng = np.random.default_rng([seed, cars])
        self._speed_m_s = rng.uniform(*settings.speed_m_s)
        self._gaps_m = self._speed_m_s * rng.uniform(*settings.headway_s, cars)
        self._decelerations_m_s2 = rng.uniform(*settings.deceleration_m_s2, cars)
        noise = rng.normal(size=(2, cars))
        self._unwarned_s = case.reaction_median_s * np.exp(settings.reaction_sigma * noise[0])
        self._warned_reaction_s = settings.warned_median_s * np.exp(
            settings.warned_sigma * noise[1]
        )
        positions_m = -np.cumsum(self._gaps_m + _LENGTH_M)
        self._radios = np.flatnonzero(rng.random(cars) < case.share).tolist()
        self._plates = [text_of("LL###LL", rng) for _ in range(cars)]
        self._ids = [car_id_of(plate) for plate in self._plates]
        self._lcca = {
            car: study_lcca(
                self._plates[car],
                _temporary_id(car),
                settings.lcca.parameters(),
                np.random.default_rng([seed, car]),
            )
            for car in self._radios
        }
        speedometers = rng.uniform(*_SPEEDOMETER, cars)
        self._measured_m_s = np.round(self._speed_m_s * speedometers / KM_H) * KM_H
        self._sights = {car: self._sight(car, case.sight, seed) for car in self._radios if car}
        self._identifying = {
            car for car, sight in self._sights.items() if isinstance(sight, MeasuredSight)
        }
        """Cars that compare speeds on the air with their lead's."""
        self._lossy_channel = LossyChannel(
            positions_m,
            self._radios,
            LossyReach(settings.reach_m, settings.loss, np.random.default_rng([seed, cars, 1])),
        )
        self._channel: LossyChannel | PlatoonChannel = self._lossy_channel
        self._step_s = _STEP_S
        channel = settings.csma or settings.sidelink
        if channel is not None:
            self._channel = PlatoonChannel(
                channel,
                positions_m,
                self._radios,
                settings.background_traffic,
                np.random.default_rng([seed, cars, 2]),
                begin_s=-settings.forming_s,
            )
            self._step_s = CHANNEL_STEP_S
        self._cautions: PlatoonCautions | None = None
        if case.cautions != "off":
            self._cautions = PlatoonCautions(
                case.cautions,
                self._radios,
                positions_m,
                self._gaps_m / self._speed_m_s,
                self._speed_m_s,
                speedometers,
                np.random.default_rng([seed, cars, 4]),
            )
        self.brakes_s = [0.0] + [math.inf] * (cars - 1)
        self.warned_s = [math.inf] * cars
        self._braking_detected: set[int] = set()
        self._acts_at = dict.fromkeys(self._lcca, -math.inf)
        """When each car's cores are next to be asked: at once after all that they are given."""
        self.followers = sum(car - 1 in self._lcca for car in self._sights)
        """Cars with a radio behind a car with a radio."""
        self.known = self.wrongly_known = 0
        """Those of them that know their lead when the first car brakes; that take it for another
        one."""
        self.cautioned = self.wrongly_cautioned = 0
        """Cautions of a car ahead that brakes, and of one behind."""
        self.warn_messages = 0
        self.events = 0
        self.flooding_messages = 0

    def drive(self) -> None:
        """Simulate until every car brakes."""
        for step in count():
            if all(map(math.isfinite, self.brakes_s)):
                return
            now = step * self._step_s - self._settings.forming_s
            self._react(now)
            self._detect(now)
            if step % round(_SPEED_INTERVAL_S / self._step_s) == 0:
                self._measure_speeds(now)
            if now < 0.0:
                self._count_known()
            self._look(now)
            self._deliver(now)
            for car, lcca in self._lcca.items():
                if self._acts_at[car] <= now:
                    handle_timers(lcca, now)
                    self._send(car, now)
                    self._acts_at[car] = timer_of(lcca)

    def crashes(self) -> int:
        """Number of cars that hit their lead."""
        lag_s = tolerable_lag_s(
            self._gaps_m[1:],
            np.array(self._speed_m_s),
            np.array(self._speed_m_s),
            self._decelerations_m_s2[:-1],
            self._decelerations_m_s2[1:],
        )
        return int((np.diff(self.brakes_s) > lag_s).sum())

    def _react(self, now: float) -> None:
        for car in range(1, len(self.brakes_s)):
            if math.isinf(self.brakes_s[car]):
                brake_lights_s = self.brakes_s[car - 1] + self._unwarned_s[car]
                warning_s = self.warned_s[car] + self._warned_reaction_s[car]
                if min(brake_lights_s, warning_s) <= now:
                    self.brakes_s[car] = now

    def _detect(self, now: float) -> None:
        """Cars with a radio detect their own hard braking, and warn."""
        for car in self._radios:
            if (
                car in self._braking_detected
                or self.brakes_s[car] + self._settings.detection_s > now
            ):
                continue
            self._braking_detected.add(car)
            self.events += 1
            self.flooding_messages += self._lossy_channel.reached_by_flooding(car)
            brake = HardBrake(now, float(self._decelerations_m_s2[car]), "study")
            self._awake(car).receive_hard_brake(brake, now)

    def _sight(self, car: int, sight: Sight, seed: int) -> AssumedSight | MeasuredSight:
        rng = np.random.default_rng([seed, car, 3])
        gap_m, plate = float(self._gaps_m[car]), self._plates[car - 1]
        phase_s = float(rng.uniform(0.0, 1.0 / FPS)) - self._settings.forming_s
        if sight not in LENSES:
            reach_m = math.inf if sight == "unlimited" else float(sight)
            return AssumedSight(self._lcca[car], gap_m, plate, phase_s, reach_m)
        view = ClearView(lambda _: [("ahead", SceneCar(gap_m, plate=plate))])
        return MeasuredSight(self._lcca[car], view, LENSES[str(sight)], phase_s, rng)

    def _measure_speeds(self, now: float) -> None:
        """Report the initial speeds; later ones, as later gaps, do not influence the result."""
        for car in self._lcca:
            self._awake(car).receive_speed(
                Speed(now, float(self._measured_m_s[car]), KM_H, "study"), now
            )

    def _look(self, now: float) -> None:
        for car, sight in self._sights.items():
            if sight.get_timer() <= now:
                sight.look(now)
                self._awake(car)

    def _count_known(self) -> None:
        leads = {car: self._sights[car].lead_id for car in self._sights}
        self.known = sum(
            each == self._ids[car - 1] for car, each in leads.items() if car - 1 in self._lcca
        )
        self.wrongly_known = sum(
            each not in (None, self._ids[car - 1]) for car, each in leads.items()
        )

    def _awake(self, car: int) -> LccaApplication:
        """Return the cores of a car, which are given something and asked in this step."""
        self._acts_at[car] = -math.inf
        return self._lcca[car]

    def _send(self, car: int, now: float) -> None:
        for warning in take_warnings(self._lcca[car], now):
            if isinstance(warning, WarningRaised):
                self.warned_s[car] = min(self.warned_s[car], now)
        for message in self._lcca[car].messages_to_send(now):
            self.warn_messages += isinstance(message, Warn) and message.is_first
            self._channel.send(car, message, now)

    def _deliver(self, now: float) -> None:
        for message, receivers in list(self._channel.received(now)):
            for car in receivers:
                self._awake(car).receive_message(message, None, now, now)
                self._send(car, now)
        if self._cautions is not None:
            self._cautions.advance(now)
        for sender, receivers in self._channel.bsms_received(now):
            if self._cautions is not None and sender in self._braking_detected:
                for car in self._cautions.receive_braking(sender, receivers, now):
                    self.warned_s[car] = min(self.warned_s[car], now)
                    self.cautioned += car > sender
                    self.wrongly_cautioned += car < sender
            temporary_id, speed_m_s = _temporary_id(sender), float(self._measured_m_s[sender])
            for car in self._identifying.intersection(receivers):
                self._awake(car).identification.receive_speed_on_air(
                    temporary_id, temporary_id, speed_m_s, now
                )


def _temporary_id(car: int) -> bytes:
    return car.to_bytes(4)
