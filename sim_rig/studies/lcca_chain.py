"""Chain collisions in a platoon, with and without LCCA, and the channel load of its warnings.

The first car brakes hard. Every driver brakes one reaction time after the car ahead, or after a
warning. Whether a car then hits the car ahead follows from the closed form that channel access uses
(`onboard/access/rear_end.py`). The warnings come from the cores of `onboard`; a car without a radio
is detected by the camera behind it, but neither sends nor receives warnings.
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
from onboard.lcca.events import PrecedingVehicle, WarningRaised
from onboard.lcca.group import WarningGroup
from onboard.lcca.settings import LccaSettings
from onboard.messages.lcca import Warn
from onboard.observations import HardBrake
from onboard.settings import Settings
from sim_rig.scenario.radio_settings import CsmaSettings
from sim_rig.scenario.setting_types import Positive, Several, Share, Span
from sim_rig.studies.campaign import Row, Workers, run_campaign
from sim_rig.studies.lcca_channel import CHANNEL_STEP_S, LossyChannel, PlatoonChannel
from sim_rig.studies.results import write_results

_STEP_S = 0.01
_FRAME_S = 0.1
_LENGTH_M = 4.5


class ChainSettings(Settings):
    """One campaign; a run is one platoon under one share of radios."""

    seed: int = Field(1, ge=0)
    runs: int = Field(200, ge=1)
    """Platoons of each length."""
    cars: Several[Annotated[int, Field(ge=2, le=999)]] = (5, 10, 20)
    shares: Several[Share] = (0.0, 0.25, 0.5, 0.75, 1.0)
    """Shares of the cars with a radio."""
    reaction_medians_s: Several[Positive] = (1.0, 1.5)
    """Medians of the log-normal reaction time without a warning."""
    reaction_sigma: float = Field(0.35, ge=0.0, le=1.5)
    warned_median_s: float = Field(0.9, gt=0.0, le=5.0)
    warned_sigma: float = Field(0.3, ge=0.0, le=1.5)
    speed_m_s: Span[Positive] = (22.0, 32.0)
    headway_s: Span[Positive] = (0.8, 1.8)
    """Bumper to bumper; all gaps are below the safety distance of LCCA."""
    deceleration_m_s2: Span[Positive] = (5.0, 8.0)
    detection_s: float = Field(0.3, ge=0.0, le=2.0)
    """Time from the start of braking to its detection by the car itself."""
    reach_m: float = Field(300.0, gt=0.0)
    loss: float = Field(0.1, ge=0.0, lt=1.0)
    csma: CsmaSettings | None = None
    """The 802.11p channel; replaces `reach_m` and `loss`, and all radios send BSMs too."""
    background_traffic: int = Field(0, ge=0, le=1000)
    """With the channel: cars that only send BSMs, up to half a kilometre before and behind."""
    forming_s: float = Field(4.0, ge=1.0, le=30.0)
    """Time before the braking in which the warning groups form."""
    lcca: LccaSettings = LccaSettings()


Case = tuple[float, int, float]
"""Median of the reaction time, number of cars, share with a radio."""


def cases(settings: ChainSettings) -> list[Case]:
    """All cases of one seed, in the order of runs."""
    return [
        (median_s, cars, share)
        for median_s in settings.reaction_medians_s
        for cars in settings.cars
        for share in settings.shares
    ]


def run_one(settings: ChainSettings, number: int) -> Row:
    """Simulate one platoon; cars and drivers depend on the seed alone, not on the share."""
    of_a_seed = cases(settings)
    median_s, cars, share = of_a_seed[number % len(of_a_seed)]
    seed = settings.seed + number // len(of_a_seed)
    platoon = _Platoon(settings, cars, median_s, share, seed)
    platoon.drive()
    return {
        "cars": cars,
        "share": share,
        "reaction_median_s": median_s,
        "seed": seed,
        "crashes": platoon.crashes(),
        "warned": sum(math.isfinite(at) for at in platoon.warned_s),
        "warn_messages": platoon.warn_messages,
        "events": platoon.events,
        "flooding_messages": platoon.flooding_messages,
    }


class _Platoon:
    """Cars in one lane, number 0 first. The first car brakes at time 0."""

    def __init__(
        self, settings: ChainSettings, cars: int, median_s: float, share: float, seed: int
    ) -> None:
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
        self._groups = {
            car: WarningGroup(
                settings.lcca.parameters(), _id(car), np.random.default_rng([seed, car])
            )
            for car in self._radios
        }
        self._lossy_channel = LossyChannel(
            positions_m,
            self._radios,
            reach_m=settings.reach_m,
            loss=settings.loss,
            rng=np.random.default_rng([seed, cars, 1]),
        )
        self._channel: LossyChannel | PlatoonChannel = self._lossy_channel
        self._step_s = _STEP_S
        if settings.csma is not None:
            self._channel = PlatoonChannel(
                settings.csma,
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
            if step % round(_FRAME_S / self._step_s) == 0:
                self._measure_gaps(now)
            self._deliver(now)
            for car, group in self._groups.items():
                if group.get_timer() <= now:
                    group.handle_timer(now)
                self._send(car, group, now)

    def crashes(self) -> int:
        """Number of cars that hit the car ahead."""
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

    def _measure_gaps(self, now: float) -> None:
        """Report the initial gaps; gaps after the braking do not influence the result."""
        for car, group in self._groups.items():
            group.receive_speed(float(self._speed_m_s), now)
            ahead = PrecedingVehicle(_id(car - 1), float(self._gaps_m[car]), 0.0) if car else None
            group.receive_preceding_vehicle(ahead, now)

    def _send(self, car: int, group: WarningGroup, now: float) -> None:
        for message in group.messages_to_send(now):
            self.warn_messages += isinstance(message, Warn)
            self._channel.send(car, message, now)
        while (event := group.next_event()) is not None:
            if isinstance(event, WarningRaised):
                self.warned_s[car] = min(self.warned_s[car], now)

    def _deliver(self, now: float) -> None:
        for message, receivers in list(self._channel.received(now)):
            for car in receivers:
                self._groups[car].receive_message(message, now)
                self._send(car, self._groups[car], now)


def _id(car: int) -> bytes:
    return f"chain{car:03d}".encode()


class _Line(NamedTuple):
    """One line of the table."""

    reaction_median_s: float
    cars: int
    share_with_radio: float
    platoons: int
    crashes_per_platoon: float
    half_95: float
    """Of the 95 % interval of the crashes."""
    reduction: float
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
    write_results(out_dir, _Line._fields, table, settings, _draw(settings, table))
    first, last = table[-len(settings.shares)], table[-1]
    return (
        f"{last.cars} cars: {first.crashes_per_platoon:.1f} crashes a platoon at a share of"
        f" {first.share_with_radio:g}, {last.crashes_per_platoon:.1f} at"
        f" {last.share_with_radio:g}; {last.warn_messages_per_event:.1f} messages a warning,"
        f" {last.flooding_messages_per_event:.1f} by flooding"
    )


def _line(case: Case, rows: Sequence[Row]) -> _Line:
    median_s, cars, share = case

    def at(wanted: float) -> list[Row]:
        return [
            row
            for row in rows
            if (row["reaction_median_s"], row["cars"], row["share"]) == (median_s, cars, wanted)
        ]

    mine = at(share)
    crashes, none = [row["crashes"] for row in mine], [row["crashes"] for row in at(0.0)]
    events = sum(row["events"] for row in mine)
    error = 1.96 * np.std(crashes, ddof=1) / math.sqrt(len(crashes)) if len(crashes) > 1 else 0.0

    def per_event(column: str) -> float:
        return sum(row[column] for row in mine) / events if events else 0.0

    return _Line(
        reaction_median_s=median_s,
        cars=cars,
        share_with_radio=share,
        platoons=len(mine),
        crashes_per_platoon=float(np.mean(crashes)),
        half_95=float(error),
        reduction=1.0 - sum(crashes) / sum(none) if sum(none) else math.nan,
        warn_messages_per_event=per_event("warn_messages"),
        flooding_messages_per_event=per_event("flooding_messages"),
    )


def _draw(settings: ChainSettings, table: Sequence[_Line]) -> Figure:
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    for median_s in settings.reaction_medians_s:
        for cars in settings.cars:
            mine = [line for line in table if line[:2] == (median_s, cars)]
            shares = [line.share_with_radio for line in mine]
            label = f"{cars} cars, {median_s:g} s"
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
    last = [line for line in table if line[:2] == table[-1][:2]]
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
