"""Effect of driver-based access on the CSMA channel, with LCCA and MVS traffic.

Highway, drivers and brakings are the paper's (`highway.py`). The 802.11p channel replaces
slots, and message intervals within SAE J2945/1, one for safe and one for unsafe cars, replace
access probabilities. The first car of each lane brakes. A car that receives a message of a braking
car ahead, or sees the brake lights directly ahead, brakes after its driver's reaction time, and its
messages report that from then on. With LCCA every car that begins to brake also sends a warning at
once in the highest priority, and repeats it.

All pairs of intervals use the same drops. One half of the drops selects the best pair, the other
evaluates it.
"""

import heapq
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from pydantic import Field

from onboard.access.rear_end import Array
from onboard.settings import Settings
from sim_rig.radio.channel import Channel
from sim_rig.scenario.radio_settings import CsmaSettings
from sim_rig.scenario.setting_types import Positive, Several
from sim_rig.studies.campaigns.study import Case, Results, Study
from sim_rig.studies.rakhshan.highway import (
    Drops,
    RakhshanHighwaySettings,
    collision_share_of_delays,
    collision_share_with_perfect_radio,
    collision_share_without_radio,
    draw,
    mean_and_error,
    reduction_and_error,
)

LANE_M = 3.5
BEACON_PRIORITY, WARNING_PRIORITY = 5, 7
_JITTER_S = 0.005
"""Uniform jitter of a beacon's time, either way."""
_BACKGROUND_INTERVAL_S = 0.1
_BACKGROUND_LATERAL_M = -20.0
"""Lateral position of the background traffic, from the middle of the highway."""
_SAME_S = 1e-9
"""Tolerance when two times are compared."""


class ChannelTraffic(Settings):
    """What the cars of the highway send."""

    name: str
    """What table and figure call it."""
    beacon_bytes: int = Field(gt=0, le=2_000)
    """Length of a signed BSM, with the MVS footer if there is one."""
    warns: bool = False
    """Whether cars that begin to brake send warnings (LCCA)."""


class RakhshanCsmaSettings(Settings):
    """One campaign; a run is one highway with every traffic and pair of intervals."""

    seed: int = Field(1, ge=0)
    """Of all draws, together with the number of the run."""
    drops: int = Field(60, ge=4)
    """Highways, at least 4: one half selects the best pair of intervals, the other evaluates it."""
    intervals_s: Several[Positive] = (0.1, 0.3, 0.6)
    """For safe and unsafe cars, in all pairs; all within the limits of SAE J2945/1."""
    traffics: Several[ChannelTraffic] = (
        ChannelTraffic(name="BSM with MVS", beacon_bytes=500),
        ChannelTraffic(name="BSM with MVS, LCCA", beacon_bytes=500, warns=True),
    )
    """What the cars of the highway send; all are run."""
    background_traffic: Several[Annotated[int, Field(ge=0)]] = (0, 100)
    """Cars beside the highway that send a beacon every 0.1 s."""
    background_within_m: float = Field(300.0, gt=0.0)
    """Largest distance of the background traffic from the middle of the highway, along it."""
    warning_bytes: int = Field(200, gt=0)
    """Length of a signed warning."""
    warning_repeats: int = Field(10, ge=0)
    """How often a car repeats its warning."""
    warning_every_s: float = Field(0.1, gt=0.0)
    """Between two repetitions."""
    warm_s: float = Field(0.3, ge=0.0)
    """Time before the first braking in which all cars send."""
    lanes_apart_s: float = Field(0.1, ge=0.0)
    """The first cars of the lanes begin to brake within this time."""
    longest_s: float = Field(6.0, gt=0.0)
    """Latest time at which a car is informed; used for those that no message reaches."""
    channel: CsmaSettings = CsmaSettings(nakagami_m=1.0)
    """The 802.11p channel; the default has Rayleigh fading."""
    highway: RakhshanHighwaySettings = RakhshanHighwaySettings()
    """The paper's highway, and what it leaves open."""


@dataclass(frozen=True, slots=True)
class HighwayRow:
    """One highway; all values are shares of its cars."""

    collided: list[list[list[list[float]]]]
    """By traffic, background traffic, and interval of safe and of unsafe cars."""
    unsafe: float
    without_radio: float
    """Collide with brake lights only."""
    perfect_radio: float
    """Collide with a radio without delay."""


@dataclass(frozen=True, slots=True)
class IntervalsLine:
    """One line of the table: a pair of intervals in one traffic, or a bound."""

    traffic: str
    background_traffic: int
    safe_interval_s: float | str
    unsafe_interval_s: float | str
    collided: float
    error_95: float
    reduction: float | str
    """Compared with the longest interval for all."""
    reduction_error_95: float | str


CsmaResults = Results[RakhshanCsmaSettings, HighwayRow, IntervalsLine]


def run(settings: RakhshanCsmaSettings, case: Case) -> HighwayRow:
    """Simulate one highway with all traffics and pairs of intervals."""
    drop_seed, channel_seed = np.random.SeedSequence([settings.seed, case.number]).spawn(2)
    drops = draw(settings.highway, 1, np.random.default_rng(drop_seed))
    unsafe = drops.unsafe[0]

    def part(kind: ChannelTraffic, background_cars: int, safe_s: float, unsafe_s: float) -> float:
        interval_s = np.where(unsafe, unsafe_s, safe_s)
        rng = np.random.default_rng(channel_seed)  # the same for all
        return float(
            collision_share_of_delays(
                drops, delay_s(settings, drops, rng, interval_s, (background_cars, kind))
            )[0]
        )

    each_s = settings.intervals_s
    collided = [
        [
            [[part(kind, background_cars, safe, other) for other in each_s] for safe in each_s]
            for background_cars in settings.background_traffic
        ]
        for kind in settings.traffics
    ]
    return HighwayRow(
        collided=collided,
        unsafe=float(unsafe.mean()),
        without_radio=float(collision_share_without_radio(drops)[0]),
        perfect_radio=float(collision_share_with_perfect_radio(drops)[0]),
    )


def table(settings: RakhshanCsmaSettings, rows: Sequence[HighwayRow]) -> list[IntervalsLine]:
    """A line for each traffic and pair of intervals, and the two bounds."""
    lines = []
    for kind, background_cars, pairs in _pairs(settings, rows):
        for safe, other in np.ndindex(pairs.shape[:2]):
            part, error = mean_and_error(pairs[safe, other])
            lines.append(
                IntervalsLine(
                    kind,
                    background_cars,
                    settings.intervals_s[safe],
                    settings.intervals_s[other],
                    float(part),
                    float(error),
                    *reduction_and_error(pairs[safe, other], pairs[-1, -1]),
                )
            )
    for name, shares in (
        ("brake lights only", [row.without_radio for row in rows]),
        ("radio without delay", [row.perfect_radio for row in rows]),
    ):
        part, error = mean_and_error(np.array(shares))
        lines.append(IntervalsLine(name, 0, "", "", float(part), float(error), "", ""))
    return lines


def _pairs(
    settings: RakhshanCsmaSettings, rows: Sequence[HighwayRow]
) -> Iterator[tuple[str, int, Array]]:
    """Traffic, background traffic, and shares of collisions (safe, unsafe, highways)."""
    collided = np.moveaxis(np.array([row.collided for row in rows]), 0, -1)
    for kind, by_load in zip(settings.traffics, collided, strict=True):
        for background_cars, pairs in zip(settings.background_traffic, by_load, strict=True):
            yield kind.name, background_cars, pairs


def summary(results: CsmaResults) -> str:
    """The reduction of collisions in each traffic."""
    summaries = []
    for kind, background_cars, pairs in _pairs(results.settings, results.rows):
        equal_s, safe_s, unsafe_s, reduction, error = _gain(results.settings, pairs)
        best = f"best for all {equal_s:g} s, best pair {safe_s:g}/{unsafe_s:g} s"
        fewer = f"{100 * reduction:.1f} +- {100 * error:.1f} % fewer"
        summaries.append(f"{kind}, {background_cars} background cars: {best}: {fewer}")
    without_radio, perfect_radio = (line.collided for line in results.table[-2:])
    bounds = f"brake lights only {without_radio:.4f}, radio without delay {perfect_radio:.4f}"
    return "; ".join([*summaries, bounds])


def _gain(settings: RakhshanCsmaSettings, pairs: Array) -> tuple[float, float, float, float, float]:
    """Best equal interval, best pair, and its reduction with error, by the evaluating drops."""
    half = pairs.shape[-1] // 2
    means = pairs[..., :half].mean(axis=-1)
    equal = int(np.argmin(np.diagonal(means)))
    safe, unsafe = np.unravel_index(int(np.argmin(means)), means.shape)
    if means[safe, unsafe] == means[equal, equal]:
        safe = unsafe = np.int64(equal)
    evaluated = pairs[..., half:]
    reduction, error = reduction_and_error(evaluated[safe, unsafe], evaluated[equal, equal])
    intervals = settings.intervals_s
    return intervals[equal], intervals[safe], intervals[unsafe], reduction, error


def picture(results: CsmaResults) -> Figure:
    """Draw the collision probability over the interval of unsafe cars, for each traffic."""
    settings = results.settings
    collided = np.moveaxis(np.array([row.collided for row in results.rows]), 0, -1)
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    panels = figure.subplots(1, len(settings.background_traffic), sharey=True, squeeze=False)[0]
    for load, (background_cars, axes) in enumerate(
        zip(settings.background_traffic, panels, strict=True)
    ):
        for at, kind in enumerate(settings.traffics):
            for safe, safe_s in enumerate(settings.intervals_s):
                mean, error = mean_and_error(collided[at, load, safe])
                label = f"{kind.name}, safe cars {safe_s:g} s"
                axes.errorbar(
                    settings.intervals_s,
                    mean,
                    error,
                    fmt=("-o", "--s", ":^")[safe % 3],
                    color=f"C{at}",
                    ms=3,
                    capsize=2,
                    label=label,
                )
        axes.set(xlabel="interval of unsafe cars in s", title=f"{background_cars} background cars")
    panels[0].set_ylabel("collision probability")
    panels[-1].legend(frameon=False, fontsize="x-small")
    return figure


def delay_s(
    settings: RakhshanCsmaSettings,
    drops: Drops,
    rng: np.random.Generator,
    interval_s: Array,
    case: tuple[int, ChannelTraffic],
) -> Array:
    """Reception delay D(i) of each car, in s.

    Args:
        settings: of the study.
        drops: one drop.
        rng: source of phases, jitter and backoffs.
        interval_s: (lanes, cars) beacon intervals.
        case: number of background cars, and traffic.

    Returns:
        (1, lanes, cars).
    """
    background_cars, kind = case
    apart_s = rng.uniform(0.0, settings.lanes_apart_s, settings.highway.lanes)
    propagation = _Propagation(drops, apart_s, settings.longest_s)
    channel = _channel(settings, drops, background_cars, rng)
    every_s = np.concatenate([interval_s.ravel(), np.full(background_cars, _BACKGROUND_INTERVAL_S)])
    schedule = _Schedule(settings, every_s, rng)
    while True:
        if kind.warns:
            for car in propagation.take_informed():
                schedule.warn(car, float(propagation.brakes_s[car]))
        if schedule.next_s >= propagation.all_informed_s:
            return propagation.delay_s[None]
        now, priority, sender = schedule.take()
        octets = kind.beacon_bytes if priority == BEACON_PRIORITY else settings.warning_bytes
        # Time of the channel begins at 0; the first cars brake `warm_s` later.
        channel.receive_frame(sender, octets, priority, now + settings.warm_s)
        schedule.plan_next(now, priority, sender)
        while (reception := channel.next_event()) is not None:
            propagation.receive_frame(
                reception.sender,
                reception.queued_s - settings.warm_s,
                reception.receivers,
                reception.at_s - settings.warm_s,
            )


def _channel(
    settings: RakhshanCsmaSettings, drops: Drops, background_cars: int, rng: np.random.Generator
) -> Channel:
    """A channel with the cars of the drop, lane by lane, and the background traffic."""
    along_m = drops.position_m[0]
    across_m = np.broadcast_to(LANE_M * np.arange(len(along_m))[:, None], along_m.shape)
    highway_m = np.stack([along_m, across_m], axis=-1).reshape(-1, 2)
    background_m = rng.uniform(
        -settings.background_within_m, settings.background_within_m, (background_cars, 2)
    )
    background_m[:, 1] = _BACKGROUND_LATERAL_M
    channel = Channel(settings.channel, along_m.size + background_cars, rng)
    channel.receive_positions(np.concatenate([highway_m, highway_m.mean(axis=0) + background_m]))
    return channel


_Due = tuple[float, int, int]
"""Time, priority and sender of a transmission."""


class _Schedule:
    """Schedule of transmissions: periodic beacons, and repeated warnings."""

    def __init__(
        self, settings: RakhshanCsmaSettings, every_s: Array, rng: np.random.Generator
    ) -> None:
        """Schedule the first beacon of each station.

        Args:
            settings: of the study.
            every_s: (stations,) beacon intervals.
            rng: source of phases and jitter.
        """
        self._settings = settings
        self._every_s = every_s
        self._rng = rng
        begins_s = -settings.warm_s + every_s * rng.uniform(0.0, 1.0, len(every_s))
        self._due: list[_Due] = [
            (at_s, BEACON_PRIORITY, sender) for sender, at_s in enumerate(begins_s.tolist())
        ]
        heapq.heapify(self._due)
        self._repeats_left = [settings.warning_repeats] * len(every_s)

    @property
    def next_s(self) -> float:
        """Time of the next transmission."""
        return self._due[0][0]

    def take(self) -> _Due:
        """Remove and return the next transmission."""
        return heapq.heappop(self._due)

    def warn(self, sender: int, at_s: float) -> None:
        """Schedule a warning."""
        heapq.heappush(self._due, (at_s, WARNING_PRIORITY, sender))

    def plan_next(self, now: float, priority: int, sender: int) -> None:
        """Schedule the next beacon, or the next repetition of a warning."""
        if priority == BEACON_PRIORITY:
            jitter_s = self._rng.uniform(-_JITTER_S, _JITTER_S)
            at_s = now + float(self._every_s[sender] + jitter_s)
            heapq.heappush(self._due, (at_s, priority, sender))
        elif self._repeats_left[sender]:
            self._repeats_left[sender] -= 1
            heapq.heappush(self._due, (now + self._settings.warning_every_s, priority, sender))


class _Propagation:
    """When each car is informed of the braking, and brakes; cars are numbered lane by lane."""

    def __init__(self, drops: Drops, begins_s: Array, longest_s: float) -> None:
        """Start the propagation.

        Args:
            drops: one drop.
            begins_s: (lanes,) times at which the first cars brake.
            longest_s: latest time at which a car is informed.
        """
        _, self._lanes, self._cars = drops.reaction_s.shape
        self._reaction_s = drops.reaction_s[0].flatten()
        self._informed_s = np.full(self._lanes * self._cars, longest_s)
        self.brakes_s = np.full(self._lanes * self._cars, math.inf)
        self._informed: list[int] = []
        self._reaction_s[:: self._cars] = 0.0
        self._begins_s = begins_s
        for lane, begin_s in enumerate(begins_s.tolist()):
            self._inform(lane * self._cars, begin_s)

    @property
    def delay_s(self) -> Array:
        """D(i) (lanes, cars), in s."""
        return self._informed_s.reshape(self._lanes, self._cars) - self._begins_s[:, None]

    @property
    def all_informed_s(self) -> float:
        """Time until which all cars are informed, so far; it only decreases."""
        return float(self._informed_s.max())

    def take_informed(self) -> list[int]:
        """Return the cars that were informed, or informed earlier, since the last call."""
        informed, self._informed = self._informed, []
        return informed

    def receive_frame(
        self, sender: int, queued_s: float, receivers: NDArray[np.int64], at_s: Array
    ) -> None:
        """Process a frame; if its sender brakes, it informs receivers behind in the lane.

        Args:
            sender: station that sent it.
            queued_s: when the frame was made.
            receivers: (n,) stations.
            at_s: (n,) times of reception.
        """
        if sender >= len(self.brakes_s) or queued_s < self.brakes_s[sender] - _SAME_S:
            return
        last = (sender // self._cars + 1) * self._cars
        for receiver, when_s in zip(receivers.tolist(), at_s.tolist(), strict=True):
            if sender < receiver < last:
                self._inform(receiver, when_s)

    def _inform(self, car: int, at_s: float) -> None:
        """Inform a car at `at_s`, unless it is earlier, and those behind by brake lights."""
        while at_s < self._informed_s[car]:
            self._informed_s[car] = at_s
            self.brakes_s[car] = at_s + self._reaction_s[car]
            self._informed.append(car)
            at_s, car = float(self.brakes_s[car]), car + 1
            if car % self._cars == 0:
                return


STUDY = Study(
    name="rakhshan-csma",
    sentence="What driver-based access gains on the 802.11p channel, with traffic of LCCA and MVS.",
    settings=RakhshanCsmaSettings,
    repeat=lambda settings: settings.drops,
    case=Case,
    run=run,
    row=HighwayRow,
    table=table,
    line=IntervalsLine,
    picture=picture,
    summary=summary,
)
