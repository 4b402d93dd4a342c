"""The events of a collision study: a fair sample over all its scenes."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from sim_rig.roads.event_order import EventCandidate, FairOrder
from sim_rig.roads.events import TrafficEvent, TrafficEventKind, TrafficEvents
from sim_rig.roads.recording import RecordedTraffic
from sim_rig.studies.mvs.scenes import OpenScene, SceneSource, open_scene


class SampledEvent(NamedTuple):
    """One event, and where it is."""

    source: SceneSource
    scene: OpenScene
    event: TrafficEvent

    @property
    def recording(self) -> RecordedTraffic:
        """The traffic without the event."""
        return self.scene.recording


class EventSample:
    """The events of every kind by number: the same scenes always have the same ones."""

    def __init__(self, sources: Sequence[SceneSource]) -> None:
        """Load the scenes."""
        self._scenes = [(source, open_scene(source)) for source in sources]
        self._orders: dict[TrafficEventKind, FairOrder] = {}

    def order(self, kind: TrafficEventKind) -> FairOrder:
        """All events of one kind.

        Raises:
            NoEventError: a scene has no event of this kind.
        """
        if kind not in self._orders:
            candidates = (
                EventCandidate(at, situation)
                for at, (_, scene) in enumerate(self._scenes)
                for situation in TrafficEvents(
                    scene.recording, has_lights=scene.has_lights
                ).situations(kind, np.random.default_rng(at))
            )
            self._orders[kind] = FairOrder(candidates, np.random.default_rng(0))
        return self._orders[kind]

    def event(self, kind: TrafficEventKind, number: int) -> SampledEvent:
        """One event by its number, from 0 on."""
        candidate = self.order(kind)[number]
        return SampledEvent(*self._scenes[candidate.recording], candidate.situation.event)


@cache
def event_sample(sources: tuple[SceneSource, ...]) -> EventSample:
    """The sample of these scenes, made once in a process."""
    return EventSample(sources)
