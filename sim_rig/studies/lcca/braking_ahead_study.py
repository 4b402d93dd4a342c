"""Whom the alarms of braking ahead take for a car ahead in the own lane on a dense road.

Hosts drive on a road with three lanes each way (`dense_road.py`), all cars have radios, and each
car's hard braking is judged again and again. Braking itself changes nothing here: each is judged
when it begins.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field

from onboard.settings import Settings
from sim_rig.roads.cars import Array
from sim_rig.scenario.setting_types import NotNegative, Positive, Several, Span
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study
from sim_rig.studies.lcca.caution_host import CautionHost, Receivers, State, shown
from sim_rig.studies.lcca.dense_road import CARS, LANES, DenseRoad

STEP_S, SAMPLE_S = 0.1, 0.5
"""Of the road; between two BSMs of a car, of which the alarm takes no more."""
SETTLING_S = 60.0
JUDGED_EVERY_S = 10.0
RADIO_M = 300.0
SPEEDOMETER = (1.006, 0.005)
"""What OBD says of the true speed: mean and sigma."""

Receiver = Literal["none"] | NotNegative
"""Whether cars have GNSS, and the sigma in m of the errors that two cars do not share."""


class BrakingAheadSettings(Settings):
    """One campaign; a run is one road."""

    seed: int = Field(1, ge=0)
    """Of the first road; each further one of a case has the next."""
    runs: int = Field(6, ge=1)
    """Roads of each case."""
    hosts: int = Field(3, ge=1, le=CARS // 2)
    """Of a road, in the middle of its rows."""
    receivers: Several[Receiver] = ("none", 0.45, 0.7)
    """`none`, or the sigma in m of the errors of positions that two cars do not share: 0.45 if
    they share 60 % of the variance of 0.7 m, and 0.7 if they share nothing."""
    speed_m_s: Span[Positive] = (18.0, 30.0)
    """Range of the speed of a road; it is uniform."""
    seconds: float = Field(300.0, ge=10.0, le=3600.0)
    """Duration of a run after the rows have formed."""
    brakings_per_h: float = Field(1.0, gt=0.0)
    """Hard brakings of each car."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BrakingAheadCase(Case):
    """One road."""

    receivers: Receiver


def axes(settings: BrakingAheadSettings) -> Axes:
    """Every kind of receivers."""
    return {"receivers": settings.receivers}


@dataclass(frozen=True, slots=True)
class BrakingAheadRow:
    """One road. Brakings judged, and those of them that the driver is cautioned of."""

    receivers: str
    judgings: int
    """Times at which all cars in range were judged by a host."""
    own: int
    """Ahead in the own lane."""
    own_cautioned: int
    beside: int
    """Ahead in another lane of the same direction."""
    beside_cautioned: int
    behind: int
    behind_cautioned: int
    oncoming: int
    oncoming_cautioned: int


def run(settings: BrakingAheadSettings, case: BrakingAheadCase) -> BrakingAheadRow:
    """Let the hosts of one road judge."""
    rng = np.random.default_rng([settings.seed + case.repetition, 43])
    road = DenseRoad(float(rng.uniform(*settings.speed_m_s)), rng)
    has_receivers = case.receivers != "none"
    receivers = Receivers(len(road.lanes), float(case.receivers) if has_receivers else 0.0, rng)
    scales = rng.normal(*SPEEDOMETER, len(road.lanes))
    chosen = rng.permutation(_in_the_middle(road))[: settings.hosts].tolist()
    hosts = {host: CautionHost(receivers.sigma_m) for host in chosen}
    judged: Counter[str] = Counter()
    cautioned: Counter[str] = Counter()
    judgings = 0
    every = round(SAMPLE_S / STEP_S)
    for step in range(round((SETTLING_S + settings.seconds) / STEP_S)):
        road.advance(STEP_S)
        receivers.advance(STEP_S)
        if step % every:
            continue
        now = step * STEP_S
        shown_m_s = shown(road.speeds_m_s, scales)
        is_judged = now >= SETTLING_S and step % round(JUDGED_EVERY_S / STEP_S) == 0
        for car, host in hosts.items():
            offsets_m = road.offsets_m(car)
            in_range = np.flatnonzero(np.abs(offsets_m[:, 0]) < RADIO_M).tolist()
            states: dict[int, State | None] = dict.fromkeys(in_range)
            if is_judged and has_receivers:
                for other in in_range:
                    ahead_m, right_m = offsets_m[other].tolist()
                    states[other] = receivers.state(
                        other, right_m, ahead_m, _north_m_s(road, other)
                    )
            for other in in_range:
                if other != car:
                    host.receive_bsm(
                        other, shown_m_s[other], now, place=states[other], brakes=is_judged
                    )
            found = host.brakings_ahead(shown_m_s[car], states[car], now)
            if is_judged:
                judgings += 1
                judged.update(_place(road, car, other, offsets_m) for other in in_range)
                cautioned.update(_place(road, car, other, offsets_m) for other in found)
    return BrakingAheadRow(
        str(case.receivers),
        judgings,
        *(counts[place] for place in _PLACES for counts in (judged, cautioned)),
    )


_PLACES = ("own", "beside", "behind", "oncoming")


def _place(road: DenseRoad, host: int, other: int, offsets_m: Array) -> str:
    if host == other:
        return "host"
    if road.lanes[other] >= LANES:
        return "oncoming"
    if offsets_m[other, 0] < 0.0:
        return "behind"
    return "own" if road.lanes[other] == road.lanes[host] else "beside"


def _in_the_middle(road: DenseRoad) -> list[int]:
    numbers = np.arange(len(road.lanes)) % CARS
    near = (road.lanes < LANES) & (abs(numbers - CARS / 2) < CARS / 4)
    return np.flatnonzero(near).tolist()


def _north_m_s(road: DenseRoad, car: int) -> float:
    return float(road.speeds_m_s[car]) * (-1.0 if road.lanes[car] >= LANES else 1.0)


@dataclass(frozen=True, slots=True)
class BrakingAheadLine:
    """One line of the table."""

    receivers: str
    brakings_ahead: int
    """In the own lane."""
    cautioned: float
    """Share of them that the driver is cautioned of."""
    beside_cautioned: float
    """The same of brakings that do not concern the driver."""
    behind_cautioned: float
    oncoming_cautioned: float
    hosts_h: float
    """Hours that the hosts drove with judgings."""
    false_per_h: float
    """Cautions about cars that do not concern the driver, at the given rate of brakings."""
    all_per_h: float
    """The baseline: if the driver was cautioned of every hard braking on the air that does not."""


def table(
    settings: BrakingAheadSettings, rows: Sequence[BrakingAheadRow]
) -> list[BrakingAheadLine]:
    """A line for each kind of receivers."""
    return [_line(settings, str(each), rows) for each in settings.receivers]


def _line(
    settings: BrakingAheadSettings, receivers: str, rows: Sequence[BrakingAheadRow]
) -> BrakingAheadLine:
    mine = [row for row in rows if row.receivers == receivers]

    def total(name: str) -> int:
        return sum(getattr(row, name) for row in mine)

    def share(name: str) -> float:
        return total(f"{name}_cautioned") / total(name) if total(name) else math.nan

    def per_h(suffix: str) -> float:
        judged = sum(total(name + suffix) for name in _PLACES[1:])
        return settings.brakings_per_h * judged / total("judgings")

    return BrakingAheadLine(
        receivers=receivers,
        brakings_ahead=total("own"),
        cautioned=share("own"),
        beside_cautioned=share("beside"),
        behind_cautioned=share("behind"),
        oncoming_cautioned=share("oncoming"),
        hosts_h=total("judgings") * JUDGED_EVERY_S / 3600.0,
        false_per_h=per_h("_cautioned"),
        all_per_h=per_h(""),
    )


def summary(results: Results[BrakingAheadSettings, BrakingAheadRow, BrakingAheadLine]) -> str:
    """Each kind of receivers."""
    return "; ".join(
        f"receivers {line.receivers}: {line.cautioned:.0%} of the brakings ahead,"
        f" {line.false_per_h:.2f} false cautions in an hour"
        for line in results.table
    )


STUDY = Study(
    name="braking-ahead",
    sentence="Of which hard brakings on a dense road a driver is cautioned, rightly and wrongly.",
    settings=BrakingAheadSettings,
    axes=axes,
    repeat=lambda settings: settings.runs,
    case=BrakingAheadCase,
    run=run,
    row=BrakingAheadRow,
    table=table,
    line=BrakingAheadLine,
    summary=summary,
)
