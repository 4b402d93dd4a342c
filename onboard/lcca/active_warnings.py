"""The vehicles ahead in the group that brake hard now.

Each warning tells a state, and the one received last is valid: by it the braking begins, its level
changes, or it is over. A braking that is not heard of for `event_lifetime_s` has expired: its
vehicle may have no radio any more. What was sent before the end of a braking and arrives after it
is outdated. Sequence numbers decide nothing else, since everybody can count ahead.
"""

import math
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from onboard.lcca.events import WarningLevel, WarningOver, WarningRaised
from onboard.lcca.group_position import GroupPosition
from onboard.lcca.parameters import GroupParameters
from onboard.messages.lcca import CarId, Warn, WarnCause
from onboard.observations import BrakeCause

MAX_BRAKINGS = 64
"""Brakings stored, and ends; of more, the one received first expires or is forgotten."""

OUTDATED = 8
"""A warning up to so many sequence numbers older than the end of its braking is outdated. A forged
end with a number far ahead suppresses nothing."""

LEVEL_STEP_M_S2 = 1.0
"""Least change of the deceleration that is reported."""


@dataclass(slots=True)
class _Braking:
    warn: Warn
    """The one received last."""
    name: tuple[CarId, int]
    """Vehicle and first sequence number under which it was raised."""
    level_m_s2: float
    """As reported last."""
    until: float
    """When it expires without another warning."""

    def is_same(self, warn: Warn) -> bool:
        """Whether the warning is of this braking: a new ID of its vehicle gives it a new name."""
        is_renamed = warn.event_origin_id != self.warn.event_origin_id
        return warn.first_sequence == self.warn.first_sequence or (
            is_renamed and warn.cause is not WarnCause.OVER
        )


class ActiveWarnings:
    """Brakings ahead, by the present ID of the vehicle that brakes."""

    def __init__(self, parameters: GroupParameters) -> None:
        self._lifetime_s = parameters.event_lifetime_s
        self._brakings: OrderedDict[CarId, _Braking] = OrderedDict()
        self._ended: OrderedDict[tuple[CarId, int], int] = OrderedDict()
        """Sequence number of the end, by vehicle and first sequence number."""

    @property
    def warnings(self) -> Iterator[Warn]:
        """The last one of each vehicle."""
        return (each.warn for each in self._brakings.values())

    def is_outdated(self, warn: Warn) -> bool:
        """Whether it was sent before an end of the same braking that was received."""
        end = self._ended.get((warn.event_origin_id, warn.first_sequence))
        return end is not None and 0 < (end - warn.event_sequence) % (1 << 16) <= OUTDATED

    def rename(self, names: Mapping[CarId, CarId]) -> None:
        """Take the new IDs of vehicles, by the old ones.

        Of a vehicle that has raised a braking under either, the older one expires.
        """
        known = self._brakings.keys()
        new = {old: names[old] for old in known & names.keys() if names[old] not in known}
        self._brakings = OrderedDict(
            (new.get(car_id, car_id), each) for car_id, each in self._brakings.items()
        )

    def receive_warn(
        self, warn: Warn, car_id: CarId, position: GroupPosition, now: float
    ) -> Iterator[WarningRaised | WarningLevel | WarningOver]:
        """Take an accepted warning; yields what it changes.

        Args:
            warn: the warning.
            car_id: present ID of the vehicle that brakes.
            position: the own one.
            now: seconds on the cores' clock.
        """
        known = self._brakings.get(car_id)
        is_same = known is not None and known.is_same(warn)
        is_over = warn.cause is WarnCause.OVER
        if is_over:
            self._ended[warn.event_origin_id, warn.first_sequence] = warn.event_sequence
            if len(self._ended) > MAX_BRAKINGS:
                self._ended.popitem(last=False)
        if known is not None and is_over == is_same:
            yield self._end(car_id, "over", now)
        if not is_over:
            yield from self._raise_or_change(warn, car_id, position, now)

    def _raise_or_change(
        self, warn: Warn, car_id: CarId, position: GroupPosition, now: float
    ) -> Iterator[WarningRaised | WarningLevel | WarningOver]:
        active = self._brakings.pop(car_id, None)
        level_m_s2 = warn.deceleration_m_s2
        name = (warn.event_origin_id, warn.first_sequence)
        if active is None:
            yield WarningRaised(
                stamp_s=now,
                origin_id=warn.event_origin_id,
                sequence=warn.first_sequence,
                origin_number=warn.origin_number,
                group_number=position.number,
                leader_id=position.leader_id,
                cause=_cause(warn),
                deceleration_m_s2=level_m_s2,
                age_s=warn.age_s,
                hops=warn.hops,
            )
        else:
            name = active.name
            if (
                warn.cause != active.warn.cause
                or abs(level_m_s2 - active.level_m_s2) >= LEVEL_STEP_M_S2
            ):
                yield WarningLevel(now, *name, _cause(warn), level_m_s2)
            else:
                level_m_s2 = active.level_m_s2
        until = now - warn.age_s + self._lifetime_s
        if active is not None:
            until = max(until, active.until)  # the age of a copy is what its forwarder says
        self._brakings[car_id] = _Braking(warn, name, level_m_s2, until)
        if len(self._brakings) > MAX_BRAKINGS:
            yield self._end(next(iter(self._brakings)), "expired", now)

    def expire(self, now: float) -> Iterator[WarningOver]:
        """End the brakings that are not heard of any more."""
        for car_id in [key for key, each in self._brakings.items() if each.until <= now]:
            yield self._end(car_id, "expired", now)

    def get_timer(self) -> float:
        """When the next braking ends unless it is heard of; infinite without any."""
        return min((each.until for each in self._brakings.values()), default=math.inf)

    def _end(self, car_id: CarId, reason: str, now: float) -> WarningOver:
        return WarningOver(now, *self._brakings.pop(car_id).name, reason)


def _cause(warn: Warn) -> BrakeCause:
    """Return the cause, one that a later version defines as deceleration."""
    if isinstance(warn.cause, WarnCause):
        return BrakeCause[warn.cause.name]
    return BrakeCause.DECELERATION
