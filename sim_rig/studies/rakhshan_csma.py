"""Driver-based access over the CSMA channel, with LCCA and MVS traffic: does it help there?

The paper's highway (`rakhshan_highway.py`), its drivers and its brakings; but in the place of slots
the 802.11p channel, and in the place of access probabilities the intervals between messages that
SAE J2945/1 leaves a car, one for safe cars and one for unsafe ones. The first car of each lane
brakes. Who hears of it from a car ahead that brakes, or sees the brake lights right ahead, reacts
after its driver's time, and its own messages say so from then on. With LCCA every car that begins
to brake warns at once in the highest priority as well, and repeats it.

All pairs of intervals meet the same drops. Half of the drops choose the best pair, half judge it.
"""

import heapq
import math
from pathlib import Path
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
from sim_rig.studies.campaign import Row, Workers, run_campaign
from sim_rig.studies.rakhshan_highway import (
    Drops,
    RakhshanHighwaySettings,
    collided_with_perfect_radio,
    collided_without_radio,
    draw,
    late,
    mean_and_error,
    reduction_and_error,
)
from sim_rig.studies.results import write_results

LANE_M = 3.5
BEACON_PRIORITY, WARNING_PRIORITY = 5, 7
_JITTER_S = 0.005
"""So much sooner or later than planned a beacon is sent, evenly."""
_OTHERS_EVERY_S = 0.1
_OTHERS_ASIDE_M = -20.0
"""Of the middle of the highway."""
_SAME_S = 1e-9
"""Times on two clocks that differ by less are the same."""


class ChannelTraffic(Settings):
    """What is on the air."""

    name: str
    beacon_bytes: int = Field(gt=0, le=2_000)
    """A signed BSM; with the footer of shared sensing it is longer."""
    warns: bool = False
    """Whether who begins to brake warns at once (LCCA)."""


class RakhshanCsmaSettings(Settings):
    """One campaign; a run is one highway with every traffic and pair of intervals."""

    seed: int = Field(1, ge=0)
    drops: int = Field(60, ge=4)
    intervals_s: Several[Positive] = (0.1, 0.3, 0.6)
    """For safe and for unsafe cars, each with each; all within what SAE J2945/1 allows."""
    traffics: Several[ChannelTraffic] = (
        ChannelTraffic(name="BSM with MVS", beacon_bytes=500),
        ChannelTraffic(name="BSM with MVS, LCCA", beacon_bytes=500, warns=True),
    )
    others: Several[Annotated[int, Field(ge=0)]] = (0, 100)
    """Cars near by, not on the highway, that send every 0.1 s whatever the highway does."""
    others_within_m: float = Field(300.0, gt=0.0)
    warning_bytes: int = Field(200, gt=0)
    warning_repeats: int = Field(10, ge=0)
    warning_every_s: float = Field(0.1, gt=0.0)
    warm_s: float = Field(0.3, ge=0.0)
    """Everybody sends for so long before the first cars brake."""
    lanes_apart_s: float = Field(0.1, ge=0.0)
    """The first cars of the lanes begin to brake within this time, not in one microsecond."""
    longest_s: float = Field(6.0, gt=0.0)
    """Who has not heard by then hears no more."""
    channel: CsmaSettings = CsmaSettings(nakagami_m=1.0)
    highway: RakhshanHighwaySettings = RakhshanHighwaySettings()


def run_one(settings: RakhshanCsmaSettings, number: int) -> Row:
    """One highway with everything."""
    drop_seed, air_seed = np.random.SeedSequence([settings.seed, number]).spawn(2)
    drops = draw(settings.highway, 1, np.random.default_rng(drop_seed))
    unsafe = (drops.danger > settings.highway.unsafe_threshold)[0]

    def part(kind: ChannelTraffic, others: int, safe_s: float, unsafe_s: float) -> float:
        interval_s = np.where(unsafe, unsafe_s, safe_s)
        rng = np.random.default_rng(air_seed)  # the same for all
        return float(late(drops, delay_s(settings, drops, rng, interval_s, (others, kind)))[0])

    each_s = settings.intervals_s
    collided = [
        [
            [[part(kind, others, safe, other) for other in each_s] for safe in each_s]
            for others in settings.others
        ]
        for kind in settings.traffics
    ]
    return {
        "collided": collided,
        "unsafe": float(unsafe.mean()),
        "without_radio": float(collided_without_radio(drops)[0]),
        "perfect_radio": float(collided_with_perfect_radio(drops)[0]),
    }


def run(
    out_dir: Path, settings: RakhshanCsmaSettings | None = None, workers: Workers | None = None
) -> str:
    """Write table, figure and settings; says what tailoring brings in each traffic."""
    settings = settings or RakhshanCsmaSettings()
    rows = run_campaign(run_one, settings, range(settings.drops), out_dir, workers or Workers())
    collided = np.moveaxis(np.array([row["collided"] for row in rows]), 0, -1)
    lines: list[tuple[object, ...]] = []
    told = []
    for kind, by_load in zip(settings.traffics, collided, strict=True):
        for others, pairs in zip(settings.others, by_load, strict=True):
            equal_s, safe_s, unsafe_s, reduction, error = _gain(settings, pairs)
            rarest = pairs[-1, -1]
            for safe, other in np.ndindex(pairs.shape[:2]):
                part, part_error = mean_and_error(pairs[safe, other])
                fewer, fewer_error = reduction_and_error(pairs[safe, other], rarest)
                intervals_s = settings.intervals_s[safe], settings.intervals_s[other]
                sizes = (float(part), float(part_error), fewer, fewer_error)
                lines.append((kind.name, others, *intervals_s, *sizes))
            told.append(
                f"{kind.name}, {others} others: best for all {equal_s:g} s, best pair"
                f" {safe_s:g}/{unsafe_s:g} s: {100 * reduction:.1f} +- {100 * error:.1f} % fewer"
            )
    dark, dark_error = mean_and_error(np.array([row["without_radio"] for row in rows]))
    bright, bright_error = mean_and_error(np.array([row["perfect_radio"] for row in rows]))
    lines.append(("brake lights only", 0, "", "", float(dark), float(dark_error), "", ""))
    lines.append(("all at once", 0, "", "", float(bright), float(bright_error), "", ""))
    columns = (
        *("traffic", "others", "safe_interval_s", "unsafe_interval_s", "collided", "error_95"),
        *("fewer_than_all_rarest", "fewer_error_95"),
    )
    write_results(out_dir, columns, lines, settings, _figure(settings, collided))
    return "; ".join([*told, f"brake lights only {dark:.4f}, all at once {bright:.4f}"])


def delay_s(
    settings: RakhshanCsmaSettings,
    drops: Drops,
    rng: np.random.Generator,
    interval_s: Array,
    case: tuple[int, ChannelTraffic],
) -> Array:
    """When each car of the only drop hears of the braking; (1, lanes, cars), as D(i)."""
    others, kind = case
    apart_s = rng.uniform(0.0, settings.lanes_apart_s, settings.highway.lanes)
    news = _News(drops, apart_s, settings.longest_s)
    channel = _channel(settings, drops, others, rng)
    every_s = np.concatenate([interval_s.ravel(), np.full(others, _OTHERS_EVERY_S)])
    agenda = _Agenda(settings, every_s, rng)
    while True:
        if kind.warns:
            for car in news.take_told():
                agenda.warn(car, float(news.brakes_s[car]))
        if agenda.next_s >= news.all_know_s:
            return news.delay_s[None]
        now, priority, sender = agenda.take()
        octets = kind.beacon_bytes if priority == BEACON_PRIORITY else settings.warning_bytes
        # Time on the channel begins at 0; the first cars brake `warm_s` later.
        channel.receive_frame(sender, octets, priority, now + settings.warm_s)
        agenda.plan_next(now, priority, sender)
        while (reception := channel.next_event()) is not None:
            news.hear(
                reception.sender,
                reception.queued_s - settings.warm_s,
                reception.receivers,
                reception.at_s - settings.warm_s,
            )


def _channel(
    settings: RakhshanCsmaSettings, drops: Drops, others: int, rng: np.random.Generator
) -> Channel:
    """With a station for every car of the only drop, lane by lane, and for the others."""
    along_m = drops.position_m[0]
    across_m = np.broadcast_to(LANE_M * np.arange(len(along_m))[:, None], along_m.shape)
    highway_m = np.stack([along_m, across_m], axis=-1).reshape(-1, 2)
    around_m = rng.uniform(-settings.others_within_m, settings.others_within_m, (others, 2))
    around_m[:, 1] = _OTHERS_ASIDE_M
    channel = Channel(settings.channel, along_m.size + others, rng)
    channel.receive_positions(np.concatenate([highway_m, highway_m.mean(axis=0) + around_m]))
    return channel


_Due = tuple[float, int, int]
"""When something is sent, with which priority, and by whom."""


class _Agenda:
    """Who sends next: beacons for ever, each warning a few times."""

    def __init__(
        self, settings: RakhshanCsmaSettings, every_s: Array, rng: np.random.Generator
    ) -> None:
        """`every_s` is the interval of each station's beacons."""
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
        """When somebody sends next."""
        return self._due[0][0]

    def take(self) -> _Due:
        """Take what is sent next."""
        return heapq.heappop(self._due)

    def warn(self, sender: int, at_s: float) -> None:
        """Have it warn."""
        heapq.heappush(self._due, (at_s, WARNING_PRIORITY, sender))

    def plan_next(self, now: float, priority: int, sender: int) -> None:
        """Have what has just been sent sent again when it is time."""
        if priority == BEACON_PRIORITY:
            jitter_s = self._rng.uniform(-_JITTER_S, _JITTER_S)
            at_s = now + float(self._every_s[sender] + jitter_s)
            heapq.heappush(self._due, (at_s, priority, sender))
        elif self._repeats_left[sender]:
            self._repeats_left[sender] -= 1
            heapq.heappush(self._due, (now + self._settings.warning_every_s, priority, sender))


class _News:
    """Who knows since when, and brakes from when; cars are numbered lane by lane."""

    def __init__(self, drops: Drops, begins_s: Array, longest_s: float) -> None:
        """`begins_s` is when the first car of each lane brakes."""
        _, self._lanes, self._cars = drops.reaction_s.shape
        self._reaction_s = drops.reaction_s[0].flatten()
        self._knows_s = np.full(self._lanes * self._cars, longest_s)
        self.brakes_s = np.full(self._lanes * self._cars, math.inf)
        self._told: list[int] = []
        self._reaction_s[:: self._cars] = 0.0
        self._begins_s = begins_s
        for lane, begin_s in enumerate(begins_s.tolist()):
            self._tell(lane * self._cars, begin_s)

    @property
    def delay_s(self) -> Array:
        """(lanes, cars): D(i)."""
        return self._knows_s.reshape(self._lanes, self._cars) - self._begins_s[:, None]

    @property
    def all_know_s(self) -> float:
        """By when everybody knows, as far as is known now; it only comes nearer."""
        return float(self._knows_s.max())

    def take_told(self) -> list[int]:
        """Who has got to know, or sooner than thought, since this was last asked."""
        told, self._told = self._told, []
        return told

    def hear(self, sender: int, queued_s: float, receivers: NDArray[np.int64], at_s: Array) -> None:
        """A frame has arrived; if it speaks of braking, those behind in the lane know."""
        if sender >= len(self.brakes_s) or queued_s < self.brakes_s[sender] - _SAME_S:
            return
        last = (sender // self._cars + 1) * self._cars
        for receiver, when_s in zip(receivers.tolist(), at_s.tolist(), strict=True):
            if sender < receiver < last:
                self._tell(receiver, when_s)

    def _tell(self, car: int, at_s: float) -> None:
        """Let a car know at `at_s`, if it knows no sooner, and those behind see it brake."""
        while at_s < self._knows_s[car]:
            self._knows_s[car] = at_s
            self.brakes_s[car] = at_s + self._reaction_s[car]
            self._told.append(car)
            at_s, car = float(self.brakes_s[car]), car + 1
            if car % self._cars == 0:
                return


def _gain(settings: RakhshanCsmaSettings, pairs: Array) -> tuple[float, float, float, float, float]:
    """Best equal interval, best pair, and the reduction by it over drops that did not choose."""
    half = pairs.shape[-1] // 2
    means = pairs[..., :half].mean(axis=-1)
    equal = int(np.argmin(np.diagonal(means)))
    safe, unsafe = np.unravel_index(int(np.argmin(means)), means.shape)
    if means[safe, unsafe] == means[equal, equal]:
        safe = unsafe = np.int64(equal)
    judged = pairs[..., half:]
    reduction, error = reduction_and_error(judged[safe, unsafe], judged[equal, equal])
    intervals = settings.intervals_s
    return intervals[equal], intervals[safe], intervals[unsafe], reduction, error


def _figure(settings: RakhshanCsmaSettings, collided: Array) -> Figure:
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    panels = figure.subplots(1, len(settings.others), sharey=True, squeeze=False)[0]
    for load, (others, axes) in enumerate(zip(settings.others, panels, strict=True)):
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
        axes.set(xlabel="interval of unsafe cars in s", title=f"{others} other cars")
    panels[0].set_ylabel("collision probability")
    panels[-1].legend(frameon=False, fontsize="x-small")
    return figure
