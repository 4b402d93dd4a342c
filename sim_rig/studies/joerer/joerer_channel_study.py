"""Joerer et al. over the rig's 802.11p channel, with and without houses, from several distances.

The paper's Table III depends on the beacons that a car receives before its crash. This study counts
them for the approaches of `joerer_traffic` that end in a crash: with the paper's Table II, where
only the power decides (`joerer_radio`), and on the channel of `sim_rig.radio`, with fading, noise,
other stations and channel access. The distances at which the approaches begin, which the paper does
not print, are an axis of their own.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from pydantic import Field

from onboard.settings import Settings
from sim_rig.propagation.path_loss import LogDistance
from sim_rig.propagation.shadowing import Building
from sim_rig.radio.channel import Channel
from sim_rig.scenario.radio_settings import CsmaSettings
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study
from sim_rig.studies.joerer.criticality import (
    BEHAVIOURS,
    UNAVOIDABLE,
    Beacons,
    criticality,
    highest,
    last_before_unavoidable,
    received,
)
from sim_rig.studies.joerer.radio import BeaconSettings
from sim_rig.studies.joerer.traffic import (
    Approaches,
    ApproachOutcome,
    Array,
    TrafficSettings,
    simulate_approaches,
)

PRIORITY = 7
"""AC_VO, which has the contention windows and the AIFSN of Table II."""
_UPDATE_S = 0.1
"""Positions of the channel's stations are this old at most."""

Range = tuple[Annotated[float, Field(gt=0.0)], Annotated[float, Field(gt=0.0)]]


class JoererChannelSettings(Settings):
    """One campaign; a run is a range of starting distances, the first also on the channel."""

    seed: int = Field(1, ge=0)
    """Of all draws, together with the number of the run."""
    traffic: TrafficSettings = TrafficSettings()
    """The two cars that approach; `start_m` below replaces its own."""
    start_m: Several[Range] = ((100.0, 250.0), (50.0, 100.0), (100.0, 150.0), (200.0, 400.0))
    """Ranges of the initial distance from the middle of the crossing."""
    houses_from_m: Several[Annotated[float, Field(gt=0.0)] | None] = (None, 10.0)
    """From the middle of either road to the houses at the four corners; null for none."""
    radio: BeaconSettings = BeaconSettings()
    """Reception by power alone, as in the paper's Table II."""
    channel: CsmaSettings = CsmaSettings(
        data_rate_mbit_s=18,
        tx_power_dbm=13.0,
        path_loss=LogDistance(exponent=2.0),
        nakagami_m=1.0,
        frequency_ghz=5.89,
    )
    """Table II, with Rayleigh fading."""
    beacon_bytes: int = Field(300, gt=0)
    """Length of a beacon without the headers of the channel."""
    other_stations: Several[Annotated[int, Field(ge=0)]] = (0, 40)
    """Standing stations on the four roads that send a beacon every 0.1 s."""
    other_stations_within_m: float = Field(200.0, gt=0.0)
    """Largest distance of the other stations from the middle of the crossing."""
    last_s: float = Field(4.0, gt=0.0)
    """Only this long before a crash are beacons counted."""
    channel_crashes: int = Field(50, ge=1)
    """On the channel, only so many crashes are simulated."""


@dataclass(frozen=True, slots=True)
class _Crashes:
    """Approaches that end in a crash."""

    start_m: tuple[float, float]
    approaches: Approaches
    p_c: dict[str, Array]
    """(n, ticks) by behaviour, from exact data."""
    percent: float
    """Share of all approaches."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StartCase(Case):
    """One range of starting distances."""

    start_m: tuple[float, float]


def axes(settings: JoererChannelSettings) -> Axes:
    """All ranges of starting distances."""
    return {"start_m": settings.start_m}


class BeaconsLine(NamedTuple):
    """One line of the table: beacons of one interval under one kind of reception."""

    start_from_m: float
    start_to_m: float
    crash_percent: float
    radio: str
    houses_from_m: float | str
    """Empty without houses."""
    other_stations: int
    beacon_interval_s: float
    cars: int
    received_percent: float
    reached_100_percent: float
    """Cars that receive a beacon with a collision probability of 100 %."""
    without_lbu_percent: float
    """Cars that receive no beacon before the crash is unavoidable."""
    uniform_99: float | str
    """The collision probability at the last beacon before that, which 99 % of the cars exceed."""
    uniform_95: float | str
    triangular_99: float | str
    triangular_95: float | str


@dataclass(frozen=True, slots=True)
class StartRow:
    """One range of starting distances."""

    rows: list[BeaconsLine]


ChannelResults = Results[JoererChannelSettings, StartRow, BeaconsLine]


def run(settings: JoererChannelSettings, case: StartCase) -> StartRow:
    """Simulate the approaches of one range of starting distances, and their beacons."""
    traffic_seed, radio_seed = np.random.SeedSequence([settings.seed, case.number]).spawn(2)
    crashes = _crashes(settings, case.start_m, np.random.default_rng(traffic_seed))
    rows = []
    for houses_from_m in settings.houses_from_m:
        rng = np.random.default_rng(radio_seed)
        rows += _rows(settings, crashes, ("Table II", houses_from_m, 0), rng)
        for others in settings.other_stations if case.number == 0 else ():
            rng = np.random.default_rng(radio_seed)
            rows += _rows(settings, crashes, ("802.11p", houses_from_m, others), rng)
    return StartRow(rows)


def table(_settings: JoererChannelSettings, rows: Sequence[StartRow]) -> list[BeaconsLine]:
    """All lines of all ranges."""
    return [line for row in rows for line in row.rows]


def summary(results: ChannelResults) -> str:
    """The share of crashes by starting distance."""
    shares = {(line.start_from_m, line.start_to_m): line.crash_percent for line in results.table}
    return "; ".join(
        f"start {begin:g} to {end:g} m: {percent:.2f} % crash"
        for (begin, end), percent in shares.items()
    )


def beacons_of_channel(
    settings: JoererChannelSettings,
    approaches: Approaches,
    houses_from_m: float | None,
    others: int,
    rng: np.random.Generator,
) -> tuple[dict[float, Beacons], dict[float, float]]:
    """Simulate the beacons of both cars over the channel.

    The cars send the beacons of all intervals in one run. They add little to a loaded channel.

    Args:
        settings: of the study.
        approaches: n approaches.
        houses_from_m: place of the houses; `None` for none.
        others: number of other stations.
        rng: source of phases, positions of the others, backoffs and fading.

    Returns:
        The beacons received, in order of car and time, and the share received, by interval in s.
    """
    got: dict[float, list[tuple[int, int]]] = {each: [] for each in settings.radio.intervals_s}
    sent = dict.fromkeys(settings.radio.intervals_s, 0)
    channel_settings = settings.channel.model_copy(
        update={"buildings": houses(houses_from_m, settings.radio.building_m)}
    )
    for approach in range(len(approaches.end_s)):
        last = int(np.ceil(approaches.end_s[approach] / approaches.tick_s))
        first = max(0, last - round(settings.last_s / approaches.tick_s))
        due = _due(settings, approaches.tick_s, (first, last), others, rng)
        channel = Channel(channel_settings, 2 + others, rng)
        place = _placing(settings, approaches, approach, others, rng)
        of_frame: dict[int, tuple[float, int, int]] = {}
        placed_s = -np.inf
        for at_s, station, interval_s, tick in due:
            channel.handle_timer(at_s)
            if at_s >= placed_s + _UPDATE_S:
                channel.receive_positions(place(tick))
                placed_s = at_s
            number = channel.receive_frame(station, settings.beacon_bytes, PRIORITY, at_s)
            if station < 2:
                of_frame[number] = interval_s, 2 * approach + 1 - station, tick
                sent[interval_s] += 1
        channel.handle_timer(np.inf)
        while (reception := channel.next_event()) is not None:
            if reception.number in of_frame and 1 - reception.sender in reception.receivers:
                interval_s, receiver, tick = of_frame[reception.number]
                got[interval_s].append((receiver, tick))
    beacons = {
        interval_s: Beacons(*np.array(sorted(pairs), dtype=np.int64).reshape(-1, 2).T)
        for interval_s, pairs in got.items()
    }
    return beacons, {each: len(got[each]) / max(sent[each], 1) for each in sent}


def houses(from_m: float | None, length_m: float) -> tuple[Building, ...]:
    """A square house at each corner of the crossing, with the losses of Table II."""
    if from_m is None:
        return ()
    near, far = from_m, from_m + length_m
    return tuple(
        Building(
            corners_m=(
                (east * near, north * near),
                (east * far, north * near),
                (east * far, north * far),
                (east * near, north * far),
            )
        )
        for east in (-1.0, 1.0)
        for north in (-1.0, 1.0)
    )


_Due = tuple[float, int, float, int]
"""Time in s, station, beacon interval in s, and tick of the cars' state."""


def _due(
    settings: JoererChannelSettings,
    tick_s: float,
    ticks: tuple[int, int],
    others: int,
    rng: np.random.Generator,
) -> list[_Due]:
    """All beacons in order of time; every station has its own phases."""
    first, last = ticks
    due: list[_Due] = []
    for station in range(2):
        for interval_s in settings.radio.intervals_s:
            every = round(interval_s / tick_s)
            # A car reads its state within a tick before it sends, at no common time.
            within_s = rng.uniform(0.0, tick_s)
            due += [
                (tick * tick_s + within_s, station, interval_s, tick)
                for tick in range(first + int(rng.integers(every)), last, every)
            ]
    for station in range(2, 2 + others):
        phase_s = rng.uniform(0.0, 0.1)
        due += [
            (at_s, station, 0.1, int(at_s / tick_s))
            for at_s in np.arange(first * tick_s + phase_s, last * tick_s, 0.1).tolist()
        ]
    return sorted(due)


def _placing(
    settings: JoererChannelSettings,
    approaches: Approaches,
    approach: int,
    others: int,
    rng: np.random.Generator,
) -> Callable[[int], Array]:
    """Positions (stations, 2) in m at a tick: the cars on two roads, the others on either."""
    along_m = rng.uniform(-1.0, 1.0, others) * settings.other_stations_within_m
    on_first = rng.random(others) < 0.5
    standing_m = np.where(on_first[:, None], [1.0, 0.0], [0.0, 1.0]) * along_m[:, None]

    def place(tick: int) -> Array:
        first_m, second_m = -approaches.distance_m[approach, tick]
        return np.concatenate([[[first_m, 0.0], [0.0, second_m]], standing_m])

    return place


def _crashes(
    settings: JoererChannelSettings, start_m: tuple[float, float], rng: np.random.Generator
) -> _Crashes:
    traffic = settings.traffic.model_copy(update={"start_m": start_m})
    approaches = simulate_approaches(traffic, rng)
    is_crash = approaches.outcome == ApproachOutcome.CRASH
    crashed = _some(approaches, np.flatnonzero(is_crash))
    p_c = {name: criticality(crashed, name, traffic) for name in BEHAVIOURS}
    return _Crashes(start_m, crashed, p_c, 100.0 * float(is_crash.mean()))


def _some(approaches: Approaches, at: NDArray[np.int64]) -> Approaches:
    return replace(
        approaches,
        outcome=approaches.outcome[at],
        end_s=approaches.end_s[at],
        ignores_rules=approaches.ignores_rules[at],
        distance_m=approaches.distance_m[at],
        speed_m_s=approaches.speed_m_s[at],
        acceleration_m_s2=approaches.acceleration_m_s2[at],
    )


def _rows(
    settings: JoererChannelSettings,
    crashes: _Crashes,
    case: tuple[str, float | None, int],
    rng: np.random.Generator,
) -> list[BeaconsLine]:
    radio, houses_from_m, others = case
    approaches, p_c_of = crashes.approaches, crashes.p_c
    if radio == "802.11p":
        approaches = _some(
            approaches, np.arange(min(settings.channel_crashes, len(approaches.end_s)))
        )
        p_c_of = {name: p_c[: len(approaches.end_s)] for name, p_c in p_c_of.items()}
        beacons, share = beacons_of_channel(settings, approaches, houses_from_m, others, rng)
    else:
        changes = {"building_m": 0.0} if houses_from_m is None else {"setback_m": houses_from_m}
        by_power = settings.radio.model_copy(update=changes)
        beacons = {
            each: _last(received(approaches, each, by_power, rng), approaches, settings.last_s)
            for each in by_power.intervals_s
        }
        share = {each: _share(beacons[each], approaches, each, settings.last_s) for each in beacons}
    rows = []
    cars = 2 * len(approaches.end_s)
    for interval_s, of_interval in beacons.items():
        lbu = {name: last_before_unavoidable(p_c_of[name], of_interval) for name in BEHAVIOURS}
        reached = highest(p_c_of["uniform"], of_interval) >= UNAVOIDABLE
        without = np.isnan(lbu["uniform"])
        rows.append(
            BeaconsLine(
                *crashes.start_m,
                crashes.percent,
                radio,
                "" if houses_from_m is None else houses_from_m,
                others,
                interval_s,
                cars,
                100.0 * share[interval_s],
                100.0 * float(reached.mean()) if cars else 0.0,
                100.0 * float(without.mean()) if cars else 0.0,
                *(_percentile(lbu[name], low) for name in BEHAVIOURS for low in (1, 5)),
            )
        )
    return rows


def _last(beacons: Beacons, approaches: Approaches, last_s: float) -> Beacons:
    age_s = approaches.end_s[beacons.car // 2] - beacons.tick * approaches.tick_s
    return Beacons(beacons.car[age_s <= last_s], beacons.tick[age_s <= last_s])


def _share(beacons: Beacons, approaches: Approaches, interval_s: float, last_s: float) -> float:
    sent = 2.0 * np.minimum(approaches.end_s, last_s).sum() / interval_s
    return float(len(beacons.car) / sent) if sent else 0.0


def _percentile(lbu: Array, low: float) -> float | str:
    """The P_C in percent that all but `low` percent exceed; cars without an LBU do not count."""
    finite = lbu[np.isfinite(lbu)]
    return 100.0 * float(np.percentile(finite, low)) if len(finite) else ""


def picture(results: ChannelResults) -> Figure:
    """Draw the threshold for 95 % over the beacon interval, for each radio and house."""
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    lines: dict[str, list[tuple[float, float | str]]] = {}
    for line in results.table:
        if line[:2] != results.table[0][:2] or line.uniform_95 == "":
            continue
        where = line.houses_from_m
        name = f"{line.radio}, " + ("no houses" if where == "" else f"houses from {where} m")
        name += f", {line.other_stations} others" if line.other_stations else ""
        lines.setdefault(name, []).append((line.beacon_interval_s, line.uniform_95))
    for name, points in lines.items():
        axes.plot(*zip(*points, strict=True), "o-", ms=3, label=name)
    axes.plot([1.0, 0.5, 0.1, 0.04], [25, 48, 87, 95], "k*", ms=10, label="paper")
    axes.set(xscale="log", xlabel="beacon interval, s", ylabel="P_C of LBU, exceeded by 95 %, %")
    axes.legend(frameon=False, fontsize=7)
    return figure


STUDY = Study(
    name="joerer-channel",
    sentence="Which beacons arrive before a crash at a crossing, by power alone and on a channel.",
    settings=JoererChannelSettings,
    axes=axes,
    case=StartCase,
    run=run,
    row=StartRow,
    table=table,
    line=BeaconsLine,
    picture=picture,
    summary=summary,
)
