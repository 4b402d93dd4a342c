"""The vehicles ahead in the group that brake hard now.

Each warning tells a state, and the newest one of a vehicle is valid: by it the braking begins, its
level rises, or it is over. A braking that is not heard of for `event_lifetime_s` has ended, too:
its vehicle may have no radio any more.
"""

import math
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass

from onboard.lcca.events import WarningLevel, WarningOver, WarningRaised
from onboard.lcca.group_position import GroupPosition
from onboard.lcca.parameters import GroupParameters
from onboard.messages.lcca import CarId, Warn, WarnCause
from onboard.observations import BrakeCause

MAX_ORIGINS = 64
"""Vehicles whose newest warning is stored, the one received last at the end."""

OUTDATED = 8
"""A warning up to so many sequence numbers older than the newest one is outdated. A forged number
far ahead therefore suppresses none."""

LEVEL_STEP_M_S2 = 1.0
"""Least change of the deceleration that is reported."""


@dataclass(slots=True)
class _Braking:
    warn: Warn
    """The newest one."""
    level_m_s2: float
    """As reported last."""
    until: float
    """When it ends without another warning; minus infinity once it is over."""


class ActiveWarnings:
    """Brakings ahead, by the vehicle that brakes."""

    def __init__(self, parameters: GroupParameters) -> None:
        self._lifetime_s = parameters.event_lifetime_s
        self._brakings: OrderedDict[CarId, _Braking] = OrderedDict()

    def is_outdated(self, warn: Warn) -> bool:
        """Whether a newer state of the same vehicle is known."""
        known = self._brakings.get(warn.event_origin_id)
        if known is None:
            return False
        return 0 < (known.warn.event_sequence - warn.event_sequence) % (1 << 16) <= OUTDATED

    def receive(
        self, warn: Warn, position: GroupPosition, now: float
    ) -> Iterator[WarningRaised | WarningLevel | WarningOver]:
        """Take an accepted warning, the newest of its vehicle; yields what it changes."""
        origin_id = warn.event_origin_id
        is_over = warn.cause is WarnCause.OVER
        known = self._brakings.pop(origin_id, None)
        active = known if known is not None and known.until > now else None
        if active is not None and (is_over or active.warn.first_sequence != warn.first_sequence):
            yield WarningOver(now, origin_id, active.warn.first_sequence, "over")
            active = None
        level_m_s2 = warn.deceleration_m_s2
        if is_over:
            pass
        elif active is None:
            yield WarningRaised(
                stamp_s=now,
                origin_id=origin_id,
                sequence=warn.first_sequence,
                origin_number=warn.origin_number,
                group_number=position.number,
                leader_id=position.leader_id,
                cause=_cause(warn),
                deceleration_m_s2=level_m_s2,
                age_s=warn.age_s,
                hops=warn.hops,
            )
        elif (
            warn.cause != active.warn.cause
            or abs(level_m_s2 - active.level_m_s2) >= LEVEL_STEP_M_S2
        ):
            yield WarningLevel(now, origin_id, warn.first_sequence, _cause(warn), level_m_s2)
        else:
            level_m_s2 = active.level_m_s2
        until = -math.inf if is_over else now - warn.age_s + self._lifetime_s
        self._brakings[origin_id] = _Braking(warn, level_m_s2, until)
        if len(self._brakings) > MAX_ORIGINS:
            self._brakings.popitem(last=False)

    def expire(self, now: float) -> Iterator[WarningOver]:
        """End the brakings that are not heard of any more."""
        for origin_id, braking in self._brakings.items():
            if -math.inf < braking.until <= now:
                braking.until = -math.inf
                yield WarningOver(now, origin_id, braking.warn.first_sequence, "expired")

    def get_timer(self) -> float:
        """When the next braking ends unless it is heard of; infinite without any."""
        active = (each.until for each in self._brakings.values() if each.until > -math.inf)
        return min(active, default=math.inf)


def _cause(warn: Warn) -> BrakeCause:
    """Return the cause, one that a later version defines as deceleration."""
    if isinstance(warn.cause, WarnCause):
        return BrakeCause[warn.cause.name]
    return BrakeCause.DECELERATION
