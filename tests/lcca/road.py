"""A road of warning groups in virtual time: cars in lanes, and the air between them.

The cars' cores are the real ones and their messages go through the real codec. A car is given what
its camera and its bus would say, never where it is.
"""

import heapq
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count

import networkx as nx
import numpy as np

from onboard.lcca.events import MeasuredLead, Transition, WarningRaised
from onboard.lcca.group import GroupEvents, WarningGroup
from onboard.lcca.parameters import GroupParameters
from onboard.lcca.transitions import GroupEvent
from onboard.messages.lcca import CarId, GroupMessage, Warn, decode, encode
from onboard.observations import BrakeCause, Discarded, HardBrake
from tests.typed import a

FRAME_S = 0.1
CAMERA_RANGE_M = 120.0


NEXT_ID_S = 4.0
"""From a change of IDs until the next ID is given to others: when all have changed theirs."""


def car_id(name: str, epoch: int = 0) -> CarId:
    """The ID under which the car of that name is known."""
    return f"{name:_<6}{epoch:02d}".encode()


@dataclass(frozen=True)
class Air:
    """What happens to a message between two cars."""

    reach_m: float = 300.0
    loss: float = 0.0
    delay_s: float = 0.002
    jitter_s: float = 0.0
    """Up to this much more, drawn for each reception: overtaking included."""
    has_bsms: bool = False
    """Whether all send BSMs, and are known by them."""


@dataclass
class Car:
    name: str
    group: WarningGroup
    lane: int
    position_m: float
    speed_m_s: float
    epoch: int = 0
    misread_as: CarId | None = None
    has_camera: bool = True
    has_bus: bool = True
    has_radio: bool = True
    is_disputed: bool = False
    """Whether another sender uses its ID too, so that its BSMs do not count."""
    said: list[GroupEvents] = field(default_factory=list)
    wakes_at: float | None = None

    @property
    def all_ids(self) -> list[CarId]:
        """Every ID that it has had."""
        return [car_id(self.name, epoch) for epoch in range(self.epoch + 1)]

    @property
    def warnings(self) -> list[WarningRaised]:
        return [event for event in self.said if isinstance(event, WarningRaised)]

    @property
    def transitions(self) -> list[Transition]:
        return [event for event in self.said if isinstance(event, Transition)]

    @property
    def discarded(self) -> list[str]:
        return [event.reason for event in self.said if isinstance(event, Discarded)]


@dataclass(frozen=True)
class Transmission:
    at: float
    sender: str
    message: GroupMessage

    @property
    def warn(self) -> Warn:
        return a(Warn, self.message)


class Road:
    """Cars, each with a camera frame and a speed sample every `FRAME_S`, and the air."""

    def __init__(
        self,
        air: Air | None = None,
        parameters: GroupParameters | None = None,
        seed: int = 0,
        *,
        proves_ids: bool = False,
    ) -> None:
        """Start; with `proves_ids`, warnings bear what their vehicles have signed."""
        self.proves_ids = proves_ids
        self.air = air or Air()
        self.parameters = parameters or GroupParameters()
        self.now = 0.0
        self.epoch = 0
        self._changed_at = -math.inf
        self.cars: dict[str, Car] = {}
        self.sent: list[Transmission] = []
        self.drops: Callable[[Transmission, str], bool] = lambda transmission, receiver: False
        """A test's own way to lose a message on its way to a receiver."""
        self._rng = np.random.default_rng(seed)
        self._agenda: list[tuple[float, int, Callable[[], None]]] = []
        self._order = count()

    # The road

    def add(self, name: str, position_m: float, lane: int = 0, speed_m_s: float = 20.0) -> Car:
        rng = np.random.default_rng(self._rng.integers(1 << 32))
        own_id = car_id(name, self.epoch)
        group = WarningGroup(self.parameters, own_id, rng, proves_ids=self.proves_ids)
        car = self.cars[name] = Car(name, group, lane, position_m, speed_m_s, self.epoch)
        group.receive_next_own_id(car_id(name, self.epoch + 1))
        self._at(self.now + float(self._rng.uniform(0.0, FRAME_S)), lambda: self._frame(car))
        return car

    def add_row(self, names: str, gap_m: float = 20.0, lane: int = 0) -> list[Car]:
        """One car for each letter, the first one ahead."""
        return [self.add(name, -gap_m * i, lane) for i, name in enumerate(names)]

    def remove(self, name: str) -> None:
        del self.cars[name]

    def ahead_of(self, car: Car) -> Car | None:
        """The next car in the lane, if the camera sees that far."""
        ahead = [
            other
            for other in self.cars.values()
            if other.lane == car.lane and 0 < other.position_m - car.position_m < CAMERA_RANGE_M
        ]
        return min(ahead, key=lambda other: other.position_m, default=None)

    def air_graph(self) -> "nx.Graph[str]":
        """Who hears whom."""
        graph: nx.Graph[str] = nx.Graph()
        graph.add_nodes_from(self.cars)
        graph.add_edges_from(
            (a.name, b.name)
            for a in self.cars.values()
            for b in self.cars.values()
            if a is not b and abs(a.position_m - b.position_m) <= self.air.reach_m
        )
        return graph

    # Time

    def run(self, duration_s: float) -> None:
        until = self.now + duration_s
        while self._agenda and self._agenda[0][0] <= until:
            at, _, action = heapq.heappop(self._agenda)
            self.now = at
            action()
        self.now = until

    def do(self, car: Car, action: Callable[[float], None]) -> None:
        """Let something happen in a car's core, and see to what it wants then."""
        action(self.now)
        self._serve(car)

    def brake(
        self,
        name: str,
        deceleration_m_s2: float = 6.0,
        cause: BrakeCause = BrakeCause.DECELERATION,
    ) -> None:
        """Begin to brake hard, or change the level."""
        self._brake(name, HardBrake(self.now, deceleration_m_s2, "test", cause))

    def release(self, name: str) -> None:
        """Brake hard no more."""
        self._brake(name, HardBrake(self.now, 0.0, "test", is_over=True))

    def _brake(self, name: str, brake: HardBrake) -> None:
        car = self.cars[name]
        self.do(car, lambda now: car.group.receive_hard_brake(brake, now))

    def change_ids(self, spread_s: float = 0.0) -> None:
        """Everybody's digest changes, at times that differ by their clocks' errors."""
        self.epoch += 1
        self._changed_at = self.now
        for car in self.cars.values():
            at = self.now + float(self._rng.uniform(0.0, spread_s))
            self._at(at, partial(self._change_id, car, self.epoch))

    def _change_id(self, car: Car, epoch: int) -> None:
        if self._is_here(car) and car.epoch < epoch:
            car.epoch = epoch
            self.do(car, lambda now: car.group.set_own_id(car_id(car.name, epoch), now))
            self._at(self.now + NEXT_ID_S, partial(self._tell_next_id, car, epoch))

    def _tell_next_id(self, car: Car, epoch: int) -> None:
        if self._is_here(car) and car.epoch == epoch:
            car.group.receive_next_own_id(car_id(car.name, epoch + 1))

    def _knows_next_ids(self) -> bool:
        return self.now >= self._changed_at + NEXT_ID_S

    def warns(self) -> list[Transmission]:
        return [entry for entry in self.sent if isinstance(entry.message, Warn)]

    def _at(self, at: float, action: Callable[[], None]) -> None:
        heapq.heappush(self._agenda, (at, next(self._order), action))

    def _is_here(self, car: Car) -> bool:
        return self.cars.get(car.name) is car

    def _frame(self, car: Car) -> None:
        if not self._is_here(car):
            return
        self._at(self.now + FRAME_S, lambda: self._frame(car))
        if car.has_bus:
            car.group.receive_speed(car.speed_m_s, self.now)
        if car.has_camera:
            car.group.receive_lead(self._seen_by(car), self.now)
        self._serve(car)
        if self.air.has_bsms and car.has_radio and not car.is_disputed:
            own_id = car_id(car.name, car.epoch)
            for other in self._in_reach(car):
                if self._rng.uniform() >= self.air.loss:
                    self._at(self.now + self.air.delay_s, partial(self._give_bsm, other, own_id))

    def _give_bsm(self, car: Car, sender_id: CarId) -> None:
        if self._is_here(car) and car.has_radio:
            self.do(car, lambda now: car.group.receive_bsm(sender_id, now))

    def _in_reach(self, car: Car) -> list[Car]:
        return [
            other
            for other in self.cars.values()
            if other is not car and abs(other.position_m - car.position_m) <= self.air.reach_m
        ]

    def _seen_by(self, car: Car) -> MeasuredLead | None:
        ahead = self.ahead_of(car)
        if ahead is None:
            return None
        gap_m, closing_speed_m_s = (
            ahead.position_m - car.position_m,
            car.speed_m_s - ahead.speed_m_s,
        )
        if car.misread_as:
            return MeasuredLead(car.misread_as, gap_m, closing_speed_m_s)
        # The plate is digested with the observer's own epoch, as in the car.
        return MeasuredLead(
            car_id(ahead.name, car.epoch),
            gap_m,
            closing_speed_m_s,
            previous_id=car_id(ahead.name, car.epoch - 1) if car.epoch else None,
            next_id=car_id(ahead.name, car.epoch + 1) if self._knows_next_ids() else None,
        )

    def _serve(self, car: Car) -> None:
        for message in car.group.messages_to_send(self.now):
            self._send(car, message)
        while (event := car.group.next_event()) is not None:
            car.said.append(event)
        timer = car.group.get_timer()
        if timer < math.inf and (car.wakes_at is None or timer < car.wakes_at):
            car.wakes_at = timer
            self._at(max(timer, self.now), lambda: self._wake(car, timer))

    def _wake(self, car: Car, timer: float) -> None:
        if not self._is_here(car) or car.wakes_at != timer:
            return
        car.wakes_at = None
        car.group.handle_timer(self.now)
        self._serve(car)

    def _send(self, car: Car, message: GroupMessage) -> None:
        if not car.has_radio:
            return
        transmission = Transmission(self.now, car.name, message)
        self.sent.append(transmission)
        data = encode(message)
        for other in self._in_reach(car):
            lost = self._rng.uniform() < self.air.loss or self.drops(transmission, other.name)
            delay_s = self.air.delay_s + float(self._rng.uniform(0.0, self.air.jitter_s))
            if not lost:
                self._at(self.now + delay_s, partial(self._deliver, other, data))

    def _deliver(self, car: Car, data: bytes) -> None:
        if self._is_here(car) and car.has_radio:
            message = decode(data).message
            assert isinstance(message, GroupMessage)
            if self.proves_ids and isinstance(message, Warn):
                message = replace(message, stated_at_s=self.now - message.age_s)
            car.group.receive_message(message, self.now)
            self._serve(car)


def places(road: Road) -> dict[str, tuple[str, int]]:
    """Every car's own opinion: (leader's name, number)."""
    names = {car_id(car.name, car.epoch): car.name for car in road.cars.values()}
    return {
        car.name: (names.get(car.group.leader_id, "?"), car.group.group_number)
        for car in road.cars.values()
    }


def true_places(road: Road) -> dict[str, tuple[str, int]]:
    """The oracle: who leads whom, read off the road.

    A car follows its lead if the gap is below the safety distance of 0.55 m for each
    km/h of its own speed. (Tests keep gaps out of the hysteresis.)
    """
    graph: nx.DiGraph[str] = nx.DiGraph()
    graph.add_nodes_from(road.cars)
    for car in road.cars.values():
        ahead = road.ahead_of(car)
        if ahead is None or not (ahead.has_radio and car.has_radio):
            continue
        if ahead.position_m - car.position_m < car.speed_m_s * 3.6 * 0.55:
            graph.add_edge(ahead.name, car.name)
    out: dict[str, tuple[str, int]] = {}
    for component in nx.weakly_connected_components(graph):
        row = list(nx.topological_sort(graph.subgraph(component)))
        out |= {name: (row[0], number) for number, name in enumerate(row, start=1)}
    return out


def events_of(car: Car) -> list[tuple[GroupEvent, str]]:
    """What happened to its place, and why."""
    return [(transition.event, transition.cause) for transition in car.transitions]
