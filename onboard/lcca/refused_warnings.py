"""Warnings of groups that this vehicle is not in, to be judged again when it joins one of them."""

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import replace

from onboard.messages.lcca import CarId, Warn

MAX_WARNINGS = 16
"""Warnings stored, one of each braking vehicle by each sender: whoever sends a copy chooses its age
and numbers. The one stored first is dropped."""


class RefusedWarnings:
    """The newest warning of each vehicle by each sender, and when it was received."""

    def __init__(self, lifetime_s: float) -> None:
        """Store each warning until it is `lifetime_s` old."""
        self._lifetime_s = lifetime_s
        self._warnings: OrderedDict[tuple[CarId, CarId], tuple[Warn, float]] = OrderedDict()

    def receive_warn(self, warn: Warn, now: float) -> None:
        """Store a warning that was refused."""
        names = warn.event_origin_id, warn.sender_id
        self._warnings[names] = (warn, now)
        self._warnings.move_to_end(names)
        if len(self._warnings) > MAX_WARNINGS:
            self._warnings.popitem(last=False)

    def take(self, now: float) -> Iterator[Warn]:
        """Remove all and yield those that are not too old, aged by the time they were stored."""
        warnings, self._warnings = self._warnings, OrderedDict()
        for warn, received_at in warnings.values():
            age_s = warn.age_s + now - received_at
            if age_s <= self._lifetime_s:
                yield replace(warn, age_s=age_s)
