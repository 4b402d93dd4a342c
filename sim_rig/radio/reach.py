"""Simple channel model: connectivity, delay, loss and duplication, without channel access."""

import heapq
import math
from collections.abc import Iterator
from itertools import combinations, count

import networkx as nx
import numpy as np

from sim_rig.radio.air import POSITION_INTERVAL_S, CarsAt, Delivery
from sim_rig.scenario.radio_settings import ReachSettings


class ReachAir:
    """Delivers each frame to all units in reach of its sender."""

    def __init__(
        self,
        settings: ReachSettings,
        cars_at: CarsAt,
        units: list[str],
        rng: np.random.Generator,
    ) -> None:
        """Open the channel.

        Args:
            settings: reach, delay, loss and duplication.
            cars_at: states of all cars at a `now`.
            units: names of the cars with a radio.
            rng: source of delay, loss and duplication.
        """
        self._settings = settings
        self._cars_at = cars_at
        self._units = units
        self._rng = rng
        self._order = count()
        self._in_flight: list[Delivery] = []
        self._graph: nx.Graph[str] = nx.Graph()
        self._graph_of = -1

    def reach_graph(self, now: float) -> "nx.Graph[str]":
        """Graph of the units that receive each other; updated every `POSITION_INTERVAL_S`."""
        moment = math.floor(now / POSITION_INTERVAL_S)
        if moment != self._graph_of:
            self._graph_of = moment
            self._graph = nx.Graph()
            self._graph.add_nodes_from(self._units)
            self._graph.add_edges_from(self._links(now))
        return self._graph

    def receive_wsm(self, sender: str, wsm: bytes, user_priority: int, now: float) -> None:
        """Transmit a frame to the cars in reach.

        Args:
            sender: name of the sending car.
            wsm: the frame.
            user_priority: its user priority, 0 to 7.
            now: monotonic time, s.
        """
        for receiver in self.reach_graph(now)[sender]:
            for at_s in self._arrivals(now):
                delivery = Delivery(at_s, next(self._order), sender, receiver, user_priority, wsm)
                heapq.heappush(self._in_flight, delivery)

    def wsms_to_deliver(self, now: float) -> list[Delivery]:
        """Return the copies that have arrived by `now`, in order."""
        arrived: list[Delivery] = []
        while self._in_flight and self._in_flight[0].at_s <= now:
            arrived.append(heapq.heappop(self._in_flight))
        return arrived

    def get_timer(self) -> float:
        """Return when the next copy arrives; `math.inf` when none is in flight."""
        return self._in_flight[0].at_s if self._in_flight else math.inf

    def _links(self, now: float) -> Iterator[tuple[str, str]]:
        if self._settings.neighbours is not None:
            for one, others in self._settings.neighbours.items():
                yield from ((one, other) for other in others if {one, other} <= set(self._units))
        elif self._settings.reach_m is not None:
            cars, reach_m = self._cars_at(now), self._settings.reach_m
            for one, other in combinations(self._units, 2):
                if cars[one].distance_m(cars[other]) <= reach_m:
                    yield one, other

    def _arrivals(self, now: float) -> list[float]:
        """Arrival times of the copies for one receiver: none, one or two."""
        settings = self._settings
        # The number of draws is constant, so that settings do not change other copies.
        lost, twice, late, *jitter = self._rng.random(5)
        if lost < settings.loss:
            return []
        at_s = now + settings.delay_s + (settings.hold_back_s if late < settings.reordering else 0)
        copies = 2 if twice < settings.duplication else 1
        return [at_s + share * settings.jitter_s for share in jitter[:copies]]
