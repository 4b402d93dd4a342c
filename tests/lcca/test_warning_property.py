"""Whoever is behind a vehicle that brakes hard is warned in time, and nobody else is.

Vehicles join and leave the row while the first one or another one brakes, eases and brakes again;
the air loses messages; all IDs change at some moment, by clocks that differ. A vehicle is *due* a
warning when it has had its right place behind the braking vehicle for `IN_TIME_S`.
"""

import os
from dataclasses import dataclass, field

import networkx as nx
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from onboard.lcca.events import WarningOver, WarningRaised
from tests.lcca.road import Air, Car, Road, places, true_places

IN_TIME_S = 0.5
LOOK_S = 0.05
NAMES = "ABCDEFGH"
GAP_M = 20.0
LATE_S = 4.5
"""How long a vehicle may be warned of a braking that is no longer ahead of it: lead_hold_s and
event_lifetime_s, and some news on its way."""

IN_THE_GATE = 20
EXAMPLES = int(os.environ.get("LCCA_EXAMPLES", IN_THE_GATE))


@dataclass
class Behind:
    """One vehicle, as far as it is behind the braking one."""

    due_since: float | None = None


@dataclass
class Braking:
    """A road on which one vehicle brakes, and what is found wrong with who is warned of it."""

    road: Road
    origin: Car
    is_braking: bool = False
    links: list[tuple[float, str, str]] = field(default_factory=list)
    """(when, ahead, behind) on the road."""
    behind: dict[str, Behind] = field(default_factory=dict)
    due: int = 0

    def begin(self, deceleration_m_s2: float) -> None:
        self.road.brake(self.origin.name, deceleration_m_s2)
        self.is_braking = True

    def end(self) -> None:
        self.road.release(self.origin.name)
        self.is_braking = False
        for state in self.behind.values():
            state.due_since = None

    def run(self, duration_s: float) -> None:
        end = self.road.now + duration_s
        while self.road.now < end:
            self.road.run(LOOK_S)
            self.look()

    def look(self) -> None:
        own, true = places(self.road), true_places(self.road)
        leader, number = true[self.origin.name]
        could = self.could_follow()
        for name, car in self.road.cars.items():
            if car is self.origin:
                continue
            state = self.behind.setdefault(name, Behind())
            is_behind = true[name][0] == leader and true[name][1] > number
            self.check_no_others(car, could)
            in_place = is_behind and own[name] == true[name]
            if not (
                in_place and self.is_braking and own[self.origin.name] == true[self.origin.name]
            ):
                state.due_since = None
                continue
            if state.due_since is None:
                state.due_since = self.road.now
            if self.road.now - state.due_since >= IN_TIME_S:
                self.due += 1
                assert self.is_warned(car), (name, self.road.now, state.due_since)

    def is_warned(self, car: Car) -> bool:
        """Whether a braking of the origin is raised and not over, under whichever of its names."""
        raised: set[tuple[bytes, int]] = set()
        for event in car.said:
            if isinstance(event, WarningRaised | WarningOver) and self.is_of_origin(event):
                name = (event.origin_id, event.sequence)
                (raised.add if isinstance(event, WarningRaised) else raised.discard)(name)
        return bool(raised)

    def is_of_origin(self, event: WarningRaised | WarningOver) -> bool:
        return event.origin_id in self.origin.all_ids

    def could_follow(self) -> "nx.DiGraph[str]":
        """Who was ahead of whom lately, by their names."""
        for car in self.road.cars.values():
            ahead = self.road.ahead_of(car)
            if ahead is not None:
                self.links.append((self.road.now, ahead.name, car.name))
        while self.links and self.links[0][0] < self.road.now - LATE_S:
            self.links.pop(0)
        graph = nx.DiGraph((ahead, behind) for _, ahead, behind in self.links)
        graph.add_nodes_from(self.road.cars)
        return graph

    def check_no_others(self, car: Car, could: "nx.DiGraph[str]") -> None:
        for event in car.warnings:
            assert self.is_of_origin(event)
            if event.stamp_s > self.road.now - LOOK_S:
                assert nx.has_path(could, self.origin.name, car.name), (car.name, event)


@st.composite
def acts(draw: st.DrawFn) -> list[tuple[str, str, float]]:
    """What happens, to whom, and the time until the next act."""
    what = st.sampled_from(["in", "in", "out", "brake", "brake", "ease", "harder", "ids", "wait"])
    waits_s = st.sampled_from([0.0, 0.1, 0.3, 0.6, 1.2, 2.5, 4.0])
    step = st.tuples(what, st.sampled_from(NAMES), waits_s)
    return draw(st.lists(step, min_size=4, max_size=14))


@pytest.mark.long
@given(
    cars=st.integers(2, len(NAMES)),
    apart=st.frozensets(st.sampled_from(NAMES[1:]), max_size=4),
    origin=st.integers(0, 3),
    script=acts(),
    reach_m=st.sampled_from([65.0, 125.0, 300.0]),
    loss=st.sampled_from([0.0, 0.1, 0.3]),
    spread_s=st.sampled_from([0.0, 0.3, 2.0]),
    seed=st.integers(0, 10_000),
)
@settings(
    max_examples=EXAMPLES,
    derandomize=EXAMPLES == IN_THE_GATE,
    database=None,
    phases=[Phase.explicit, Phase.generate],  # a road does not shrink in reasonable time
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
    deadline=None,
)
def test_whoever_is_behind_a_braking_vehicle_is_warned_in_time_and_nobody_else_is(  # noqa: PLR0917
    cars: int,
    apart: frozenset[str],
    origin: int,
    script: list[tuple[str, str, float]],
    reach_m: float,
    loss: float,
    spread_s: float,
    seed: int,
) -> None:
    road = Road(Air(reach_m=reach_m, loss=loss, jitter_s=0.002), seed=seed)
    for i, name in enumerate(NAMES[:cars]):
        road.add(name, -GAP_M * i, lane=1 if name in apart else 0)
    braking = Braking(road, road.cars[NAMES[origin % cars]])
    braking.run(5.0)
    for what, name, wait_s in script:
        match what:
            case "in" | "out" if name in road.cars and name != braking.origin.name:
                road.cars[name].lane = 0 if what == "in" else 1
            case "brake" | "harder":
                braking.begin(6.0 if what == "brake" else 9.0)
            case "ease":
                braking.end()
            case "ids" if road.epoch == 0:  # epochs last for minutes
                road.change_ids(spread_s)
        braking.run(wait_s)
