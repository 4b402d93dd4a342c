"""After any changes on the road, the groups match it once it stands still.

Cars come, go, change lanes and speeds, misread plates, lose camera or radio, change their IDs,
brake; the air loses, delays and reorders. Two things hold. While it happens, nobody raises a
warning of a car that it could not have been following, directly or not. When it has stopped for
five seconds, every car has the leader, number, state and followers that the road gives it, and a
warning reaches those behind in the group and nobody else.
"""

import os
from dataclasses import dataclass, field

import networkx as nx
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from onboard.lcca.transitions import GroupState
from tests.lcca.road import Air, Car, Road, car_id, places, true_places

GRID_M = 25.0
"""With these speeds every gap is at least 10 % off both thresholds of the hysteresis."""
SPEEDS_M_S = (10.0, 15.0, 20.0, 20.0, 20.0, 30.0)
LANES = (0, 1, 2)
STILL_S = 5.0
STALE_S = 5.0
"""How long a car may believe that it is in a group: lead_hold_s, leader_silence_s, and one second
for news on its way down the row."""

CIRCLE_S = 3.5
"""How long a circle may last: leader_silence_s, and some of it on the way round."""

NAMES = "ABCDEFGHIJ"

IN_THE_GATE = 50
EXAMPLES = int(os.environ.get("LCCA_EXAMPLES", IN_THE_GATE))
"""More, and others each time, for whoever changes the protocol: LCCA_EXAMPLES=5000 pytest ..."""


@dataclass(frozen=True)
class Step:
    what: str
    who: int
    value: int
    wait_s: float


WHATS = (
    "lane lane speed brake brake release misread misread garble reread "
    "blind deaf go come come ids wait wait"
)

steps = st.builds(
    Step,
    what=st.sampled_from(WHATS.split()),
    who=st.integers(0, len(NAMES) - 1),
    value=st.integers(0, 5),
    wait_s=st.sampled_from([0.0, 0.03, 0.1, 0.3, 0.7, 1.5, 3.0]),
)

airs = st.builds(
    Air,
    reach_m=st.sampled_from([100.0, 140.0, 300.0]),
    loss=st.sampled_from([0.0, 0.1, 0.3]),
    jitter_s=st.sampled_from([0.0, 0.01, 0.08]),
    has_bsms=st.booleans(),
)


@dataclass
class Drive:
    """A road, what has been done to it, and who could follow whom when."""

    road: Road
    mute: frozenset[str]
    """Cars without a radio: on the road, but in nobody's group."""
    links: list[tuple[float, str, str]] = field(default_factory=list)
    """(when, ahead, behind) that a camera showed, rightly or not."""
    checked: dict[str, int] = field(default_factory=dict)
    added: int = 0
    circle_since: float | None = None
    misread_at: float = -STALE_S

    def add(self, name: str, lane: int, slot: int) -> None:
        if name in self.road.cars or self.is_taken(lane, slot):
            return
        car = self.road.add(name, -GRID_M * slot, lane)
        car.has_radio = name not in self.mute
        self.added += 1
        self.checked[name] = 0

    def is_taken(self, lane: int, slot: int) -> bool:
        place = (lane, -GRID_M * slot)
        return any((car.lane, car.position_m) == place for car in self.road.cars.values())

    def take(self, step: Step) -> None:
        name = NAMES[step.who]
        car = self.road.cars.get(name)
        if step.what == "come":
            self.add(name, step.value % len(LANES), step.who)
        elif step.what == "ids":
            self.road.change_ids(spread_s=0.5)
        elif car is not None:
            self.do(step, car)
        self.watch(step.wait_s)

    def do(self, step: Step, car: Car) -> None:
        slot = round(-car.position_m / GRID_M)
        match step.what:
            case "lane" if not self.is_taken(lane := step.value % len(LANES), slot):
                car.lane = lane
            case "speed":
                car.speed_m_s = SPEEDS_M_S[step.value % len(SPEEDS_M_S)]
            case "misread":
                car.misread_as = car_id(NAMES[step.value], car.epoch)
            case "garble":
                car.misread_as = car_id("nobody")
            case "reread":
                car.misread_as = None
            case "blind":
                car.has_camera = not car.has_camera
            case "deaf":
                car.has_radio = not car.has_radio and car.name not in self.mute
            case "go":
                self.road.remove(car.name)
            case "brake":
                self.road.brake(car.name)
            case "release":
                self.road.release(car.name)

    def watch(self, duration_s: float) -> None:
        """Let time pass, and look at everything that was said."""
        end = self.road.now + duration_s
        while True:
            self.note_links()
            self.check()
            if self.road.now >= end:
                return
            self.road.run(min(0.1, end - self.road.now))

    def note_links(self) -> None:
        by_id = {
            car_id(name, epoch): name for name in NAMES for epoch in range(self.road.epoch + 1)
        }
        for car in self.road.cars.values():
            ahead = self.road.ahead_of(car)
            if ahead is not None:
                seen = by_id.get(car.misread_as, "?") if car.misread_as else ahead.name
                self.links.append((self.road.now, seen, car.name))
                self.misread_at = self.road.now if seen != ahead.name else self.misread_at
        while self.links and self.links[0][0] < self.road.now - STALE_S:
            self.links.pop(0)

    def check(self) -> None:
        could: nx.Graph[str] = nx.DiGraph((ahead, behind) for _, ahead, behind in self.links)
        if self.misread_at > self.road.now - STALE_S:
            could = could.to_undirected()  # Two cars follow one: the row has become a tree.
        for car in self.road.cars.values():
            for warning in car.warnings[self.checked[car.name] :]:
                origin = warning.origin_id[:1].decode()
                assert origin != car.name
                assert nx.has_path(could, origin, car.name), (origin, car.name)
            self.checked[car.name] = len(car.warnings)
            assert car.group.group_number <= self.added
        self.check_for_circles()

    def check_for_circles(self) -> None:
        """Misread plates may close a circle, but it neither counts up nor lasts."""
        names = {own_id: car.name for car in self.road.cars.values() for own_id in car.all_ids}
        follows = nx.DiGraph(
            (car.name, names.get(car.group.predecessor_id or b"", "?"))
            for car in self.road.cars.values()
        )
        follows.remove_nodes_from(["?"])
        if nx.is_directed_acyclic_graph(follows):
            self.circle_since = None
        elif self.circle_since is None:
            self.circle_since = self.road.now
        else:
            assert self.road.now - self.circle_since < CIRCLE_S

    def stand_still(self) -> None:
        for car in self.road.cars.values():
            car.misread_as = None
            car.has_camera = True
            car.has_radio = car.name not in self.mute
        self.watch(STILL_S)


def assert_groups_are_the_roads(road: Road) -> None:
    truth = true_places(road)
    assert places(road) == truth
    for car in road.cars.values():
        leader, number = truth[car.name]
        behind = [name for name, place in truth.items() if place == (leader, number + 1)]
        assert [follower[:1].decode() for follower in car.group.followers] == behind
        alone = GroupState.LEADER if behind else GroupState.REGULAR
        assert car.group.state is (GroupState.MEMBER if number > 1 else alone)


def assert_each_warning_reaches_its_group_only(drive: Drive) -> None:
    """Everybody brakes in turn; those behind in the group are warned, and nobody else."""
    road = drive.road
    truth = true_places(road)
    for name in road.cars:
        road.release(name)
    road.run(1.0 + road.parameters.event_lifetime_s)
    before = {car.name: len(car.warnings) for car in road.cars.values()}
    for name in road.cars:
        road.brake(name)
        road.run(0.3)
        road.release(name)
    road.run(1.5)
    for car in road.cars.values():
        leader, number = truth[car.name]
        ahead = sorted(name for name, (its, n) in truth.items() if its == leader and n < number)
        heard = sorted(w.origin_id[:1].decode() for w in car.warnings[before[car.name] :])
        assert len(set(heard)) == len(heard)
        assert set(heard) <= set(ahead)
        assert heard == ahead or road.air.loss > 0.0


@pytest.mark.long
@given(
    lanes=st.lists(st.sampled_from((0, 0, 0, 1, 2)), min_size=7, max_size=len(NAMES)),
    mute=st.frozensets(st.sampled_from(NAMES), max_size=1),
    script=st.lists(steps, min_size=8, max_size=25),
    air=airs,
    seed=st.integers(0, 1000),
)
@settings(
    max_examples=EXAMPLES,
    derandomize=EXAMPLES == IN_THE_GATE,
    database=None,
    phases=[Phase.explicit, Phase.generate],  # a road does not shrink in reasonable time
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
def test_after_the_last_change_on_the_road_the_groups_match_it(
    lanes: list[int],
    mute: frozenset[str],
    script: list[Step],
    air: Air,
    seed: int,
) -> None:
    drive = Drive(Road(air, seed=seed), mute)
    for slot, lane in enumerate(lanes):
        drive.add(NAMES[slot], lane, slot)
    for step in script:
        drive.take(step)
    drive.stand_still()
    assert_groups_are_the_roads(drive.road)
    assert_each_warning_reaches_its_group_only(drive)
