"""Chain collisions in a platoon, with and without LCCA, and the channel load of its warnings.

The first car brakes hard. Every driver brakes one reaction time after its lead, or after a
warning. Whether a car then hits its lead follows from the closed form that channel access uses
(`onboard/access/rear_end.py`). The warnings come from the cores of `onboard`. Which car is ahead is
found out by the camera model and these cores (`platoon_sight.py`), or assumed to be known; a car
without a radio is seen by the camera behind it, but neither answers nor warns.
"""

import math
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from pydantic import Field

from onboard.access.rear_end import tolerable_lag_s
from onboard.kinematics.units import KM_H
from onboard.lcca.events import WarningRaised
from onboard.lcca.group import WarningGroup
from onboard.lcca.identification import Identification
from onboard.lcca.settings import LccaSettings
from onboard.messages.lcca import Answer, Inquiry, LccaMessage, Warn
from onboard.observations import HardBrake
from onboard.settings import Settings
from sim_rig.cars.camera_view import FPS
from sim_rig.rendering.plate_texts import text_of
from sim_rig.rendering.scene import SceneCar
from sim_rig.scenario.radio_settings import CsmaSettings, SidelinkSettings
from sim_rig.scenario.setting_types import Positive, Several, Share, Span
from sim_rig.studies.campaigns.campaign import Row, Workers, run_campaign
from sim_rig.studies.campaigns.intervals import half_interval
from sim_rig.studies.campaigns.results import write_results
from sim_rig.studies.lcca.platoon_channel import CHANNEL_STEP_S, LossyChannel, PlatoonChannel
from sim_rig.studies.lcca.platoon_sight import (
    LENSES,
    AssumedSight,
    ClearView,
    MeasuredSight,
    Sight,
    car_id_of,
)

_STEP_S = 0.01
_SPEED_INTERVAL_S = 0.1
_LENGTH_M = 4.5
_RESAMPLES = 2000
"""Of the bootstrap."""
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
    """How cars know the one ahead: `unlimited`; by the camera model with the `recommended` lens or
    the one of the `rig`; or up to so many metres."""
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


Case = tuple[float, int, Sight, float]
"""Median of the reaction time, number of cars, how they know the one ahead, share with a radio."""


def cases(settings: ChainSettings) -> list[Case]:
    """All cases of one seed, in the order of runs."""
    return [
        (median_s, cars, sight, share)
        for median_s in settings.reaction_medians_s
        for cars in settings.cars
        for sight in settings.sights
        for share in settings.shares
    ]


def run_one(settings: ChainSettings, number: int) -> Row:
    """Simulate one platoon; cars and drivers depend on the seed alone, not on the share."""
    of_a_seed = cases(settings)
    case = of_a_seed[number % len(of_a_seed)]
    median_s, cars, sight, share = case
    seed = settings.seed + number // len(of_a_seed)
    platoon = _Platoon(settings, case, seed)
    platoon.drive()
    return {
        "cars": cars,
        "sight": str(sight),
        "share": share,
        "reaction_median_s": median_s,
        "seed": seed,
        "crashes": platoon.crashes(),
        "followers": platoon.followers,
        "known": platoon.known,
        "wrongly_known": platoon.wrongly_known,
        "warned": sum(math.isfinite(at) for at in platoon.warned_s),
        "warn_messages": platoon.warn_messages,
        "events": platoon.events,
        "flooding_messages": platoon.flooding_messages,
    }


class _Platoon:
    """Cars in one lane, number 0 first. The first car brakes at time 0."""

    def __init__(self, settings: ChainSettings, case: Case, seed: int) -> None:
        median_s, cars, sight, share = case
        self._settings = settings
        rng = np.random.default_rng([seed, cars])
        self._speed_m_s = rng.uniform(*settings.speed_m_s)
        self._gaps_m = self._speed_m_s * rng.uniform(*settings.headway_s, cars)
        self._decelerations_m_s2 = rng.uniform(*settings.deceleration_m_s2, cars)
        noise = rng.normal(size=(2, cars))
        self._unwarned_s = median_s * np.exp(settings.reaction_sigma * noise[0])
        self._warned_reaction_s = settings.warned_median_s * np.exp(
            settings.warned_sigma * noise[1]
        )
        positions_m = -np.cumsum(self._gaps_m + _LENGTH_M)
        self._radios = np.flatnonzero(rng.random(cars) < share).tolist()
        self._plates = [text_of("LL###LL", rng) for _ in range(cars)]
        self._ids = [car_id_of(plate) for plate in self._plates]
        self._groups = {
            car: WarningGroup(
                settings.lcca.parameters(), self._ids[car], np.random.default_rng([seed, car])
            )
            for car in self._radios
        }
        speedometers = rng.uniform(*_SPEEDOMETER, cars)
        self._measured_m_s = np.round(self._speed_m_s * speedometers / KM_H) * KM_H
        self._sights = {car: self._sight(car, sight, seed) for car in self._radios if car}
        self._first = (
            Identification(self._ids[0], _temporary_id(0), np.random.default_rng([seed, 3]))
            if sight in LENSES
            else None
        )
        self._lossy_channel = LossyChannel(
            positions_m,
            self._radios,
            reach_m=settings.reach_m,
            loss=settings.loss,
            rng=np.random.default_rng([seed, cars, 1]),
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
        self.brakes_s = [0.0] + [math.inf] * (cars - 1)
        self.warned_s = [math.inf] * cars
        self._braking_detected: set[int] = set()
        self.followers = sum(car - 1 in self._groups for car in self._sights)
        """Cars with a radio behind a car with a radio."""
        self.known = self.wrongly_known = 0
        """Those of them that know their lead when the first car brakes; that take it for another
        one."""
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
            for car, group in self._groups.items():
                if group.get_timer() <= now:
                    group.handle_timer(now)
                self._send(car, group, now)

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
            self._groups[car].receive_hard_brake(brake, now)

    def _sight(self, car: int, sight: Sight, seed: int) -> AssumedSight | MeasuredSight:
        rng = np.random.default_rng([seed, car, 3])
        gap_m, plate = float(self._gaps_m[car]), self._plates[car - 1]
        phase_s = float(rng.uniform(0.0, 1.0 / FPS)) - self._settings.forming_s
        if sight not in LENSES:
            reach_m = math.inf if sight == "unlimited" else float(sight)
            return AssumedSight(gap_m, plate, phase_s, reach_m)
        identification = Identification(self._ids[car], _temporary_id(car), rng)
        seen = [("ahead", SceneCar(gap_m, plate=plate))]
        return MeasuredSight(
            identification, ClearView(lambda _: seen), LENSES[str(sight)], phase_s, rng
        )

    def _measure_speeds(self, now: float) -> None:
        """Report the initial speeds; later ones, as later gaps, do not influence the result."""
        for car, group in self._groups.items():
            group.receive_speed(float(self._measured_m_s[car]), now)
            if (core := self._identification(car)) is not None:
                core.receive_speed(float(self._measured_m_s[car]), now)

    def _look(self, now: float) -> None:
        for car, sight in self._sights.items():
            if sight.get_timer() <= now:
                self._groups[car].receive_lead(sight.look(now), now)

    def _count_known(self) -> None:
        leads = {car: self._sights[car].lead_id for car in self._sights}
        self.known = sum(
            each == self._ids[car - 1] for car, each in leads.items() if car - 1 in self._groups
        )
        self.wrongly_known = sum(
            each not in (None, self._ids[car - 1]) for car, each in leads.items()
        )

    def _identification(self, car: int) -> Identification | None:
        """Who asks which car is the lead, and answers; `None` where that is known anyway."""
        sight = self._sights.get(car)
        return self._first if car == 0 else None if sight is None else sight.identification

    def _send(self, car: int, group: WarningGroup, now: float) -> None:
        core = self._identification(car)
        inquiries: list[LccaMessage] = [] if core is None else [*core.messages_to_send()]
        for message in (*group.messages_to_send(now), *inquiries):
            self.warn_messages += isinstance(message, Warn) and message.is_first
            self._channel.send(car, message, now)
        while (event := group.next_event()) is not None:
            if isinstance(event, WarningRaised):
                self.warned_s[car] = min(self.warned_s[car], now)
        while core is not None and core.next_event() is not None:
            pass

    def _deliver(self, now: float) -> None:
        for message, receivers in list(self._channel.received(now)):
            for car in receivers:
                core = self._identification(car)
                if not isinstance(message, Inquiry | Answer):
                    self._groups[car].receive_message(message, now)
                elif core is not None:
                    core.receive_message(message, None, now)
                self._send(car, self._groups[car], now)
        for sender, receivers in self._channel.bsms_received(now):
            temporary_id = _temporary_id(sender)
            for car in receivers:
                if (core := self._identification(car)) is not None:
                    speed_m_s = float(self._measured_m_s[sender])
                    core.receive_speed_on_air(temporary_id, temporary_id, speed_m_s, now)


def _temporary_id(car: int) -> bytes:
    return car.to_bytes(4)


class _Line(NamedTuple):
    """One line of the table."""

    reaction_median_s: float
    cars: int
    sight: str
    share_with_radio: float
    platoons: int
    crashes_per_platoon: float
    half_95: float
    """Of the 95 % interval of the crashes."""
    reduction: float
    """Share of the crashes without a radio that do not happen."""
    reduction_low_95: float
    reduction_high_95: float
    known: float
    """Share of the followers that know their lead, if both have a radio, when the first car
    brakes."""
    wrongly_known: int
    warn_messages_per_event: float
    flooding_messages_per_event: float


def chain(
    out_dir: Path, settings: ChainSettings | None = None, workers: Workers | None = None
) -> str:
    """Write crashes and messages by platoon length, share of radios and reaction time.

    Args:
        out_dir: folder of table, figure, settings and runs.
        settings: of the campaign; the default ones if None.
        workers: processes or cluster; this process if None.

    Returns:
        Crashes and messages of the longest platoon, as a sentence.
    """
    settings = settings or ChainSettings()
    numbers = range(len(cases(settings)) * settings.runs)
    rows = run_campaign(run_one, settings, numbers, out_dir / "runs", workers or Workers())
    table = [_line(case, rows) for case in cases(settings)]
    write_results(out_dir, _Line._fields, table, settings, _draw(table))
    first, last = table[-len(settings.shares)], table[-1]
    return (
        f"{last.cars} cars, {last.sight}: {first.crashes_per_platoon:.1f} crashes a platoon at a"
        f" share of {first.share_with_radio:g}, {last.crashes_per_platoon:.1f} at"
        f" {last.share_with_radio:g}; {last.warn_messages_per_event:.1f} messages a warning,"
        f" {last.flooding_messages_per_event:.1f} by flooding"
    )


def _line(case: Case, rows: Sequence[Row]) -> _Line:
    median_s, cars, sight, share = case
    of_sight = (median_s, cars, str(sight))

    def at(wanted: float) -> list[Row]:
        return [
            row
            for row in rows
            if (row["reaction_median_s"], row["cars"], row["sight"]) == of_sight
            and row["share"] == wanted
        ]

    mine = at(share)
    crashes, none = [row["crashes"] for row in mine], [row["crashes"] for row in at(0.0)]
    events = sum(row["events"] for row in mine)
    error = half_interval(np.array(crashes)) if len(crashes) > 1 else 0.0

    low, high = _reduction_interval(crashes, none)
    followers = sum(row["followers"] for row in mine)

    def per_event(column: str) -> float:
        return sum(row[column] for row in mine) / events if events else 0.0

    return _Line(
        reaction_median_s=median_s,
        cars=cars,
        sight=str(sight),
        share_with_radio=share,
        platoons=len(mine),
        crashes_per_platoon=float(np.mean(crashes)),
        half_95=float(error),
        reduction=1.0 - sum(crashes) / sum(none) if sum(none) else math.nan,
        reduction_low_95=low,
        reduction_high_95=high,
        known=sum(row["known"] for row in mine) / followers if followers else math.nan,
        wrongly_known=sum(row["wrongly_known"] for row in mine),
        warn_messages_per_event=per_event("warn_messages"),
        flooding_messages_per_event=per_event("flooding_messages"),
    )


def _reduction_interval(crashes: Sequence[float], none: Sequence[float]) -> tuple[float, float]:
    """95 % interval of the reduction, by resampling the platoons, which are the same in both."""
    if not sum(none):
        return math.nan, math.nan
    picks = np.random.default_rng(0).integers(len(none), size=(_RESAMPLES, len(none)))
    totals = np.maximum(np.array(none)[picks].sum(axis=1), 1)
    reductions = 1.0 - np.array(crashes)[picks].sum(axis=1) / totals
    low, high = np.quantile(reductions, (0.025, 0.975)).tolist()
    return low, high


def _draw(table: Sequence[_Line]) -> Figure:
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    for median_s, cars, sight in dict.fromkeys(line[:3] for line in table):
        mine = [line for line in table if line[:3] == (median_s, cars, sight)]
        shares = [line.share_with_radio for line in mine]
        label = f"{cars} cars, {median_s:g} s, {sight}"
        left.errorbar(
            shares,
            [line.crashes_per_platoon for line in mine],
            [line.half_95 for line in mine],
            marker="o",
            capsize=3,
            label=label,
        )
        messages = [line.warn_messages_per_event for line in mine]
        right.plot(shares, messages, marker="o", label=f"{label}: LCCA")
    last = [line for line in table if line[:3] == table[-1][:3]]
    right.plot(
        [line.share_with_radio for line in last],
        [line.flooding_messages_per_event for line in last],
        "k--",
        label=f"{table[-1].cars} cars: flooding",
    )
    left.set_ylabel("crashes a platoon")
    right.set_ylabel("messages a warning")
    for axes in (left, right):
        axes.set_xlabel("share of cars with a radio")
        axes.legend(fontsize=7)
    return figure
