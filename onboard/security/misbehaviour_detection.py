"""Whether what a car says now agrees with what it said before.

A signature says who speaks, not that it is true. Here a speed has to be one that a car can have, to
follow from the speed before, and to fit the way between two positions; a claimed hard brake has to
show in the sender's own speeds; nobody may go by another's temporary ID. Where a sender has said
too little, it is believed.
"""

import math
from collections import OrderedDict, deque
from dataclasses import dataclass, field
from enum import StrEnum

from onboard.kinematics.geodesy import distance_m
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import VehicleEventFlags
from onboard.security.identity_claims import IdentityClaims

HIGHEST_SPEED_M_S = 90.0
"""No car on a road is faster."""
HIGHEST_ACCELERATION_M_S2 = 12.0
"""Sports tyres on dry road, both ways."""
SPEED_ERROR_M_S = 1.0
"""Two samples of a speed polled in whole km/h and some old, added to every difference."""
OLDEST_POSITION_S = 2.0
"""Of a receiver that gives one a second, and late."""
POSITION_ERROR_M = 20.0
"""A receiver that leaves a tunnel or changes satellites."""
BRAKE_M_S2 = 2.0
"""A brake counts as hard from 0.4 g (SAE J2945/1); speeds that came late show about half of it."""
BRAKE_DROP_M_S = 0.6
"""More than two steps of a speed in whole km/h, so that rounding does not look like a brake."""
BRAKE_WINDOW_S = 2.0
"""How far back the speeds are looked at."""
ENOUGH_S = 0.3
"""Speeds over less time than this prove nothing."""

FORGOTTEN_S = 60.0
"""A car not heard for so long begins anew: nothing that it said then proves anything now."""

_SENDERS = 512
_SPEEDS = 32
"""Samples kept of one sender: three seconds of BSMs."""


class Misbehaviour(StrEnum):
    """Stable words, fit for a counter's label."""

    SPEED = "implausible_speed"
    ACCELERATION = "implausible_acceleration"
    POSITION = "implausible_position"
    BRAKE = "implausible_brake"
    """A hard brake that the sender's own speeds do not show."""
    IDENTITY = "implausible_identity"
    """Another sender has been going by this temporary ID."""


@dataclass(slots=True)
class _Sender:
    speeds: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=_SPEEDS))
    """(stamp_s, speed_m_s)."""
    last: tuple[float, CoreData] | None = None


class MisbehaviourDetector:
    """What the cars around have said lately. Stamps are when a message was made, on our clock."""

    def __init__(self, *, brakes_must_show: bool = True) -> None:
        self._brakes_must_show = brakes_must_show
        self._senders: OrderedDict[bytes, _Sender] = OrderedDict()
        self._car_ids = IdentityClaims(_SENDERS)
        self._temporary_ids = IdentityClaims(_SENDERS)

    def receive_bsm(
        self, sender: bytes, message: BasicSafetyMessage, stamp_s: float
    ) -> Misbehaviour | None:
        """Compare `message` with those before it, and remember it.

        A message that was made before the last one heard is compared with it, and not remembered:
        otherwise backdated messages could say anything.

        Args:
            sender: the signer's HashedId8, or the temporary ID where nobody signs.
            message: what it says.
            stamp_s: when it was made.

        Returns:
            why it should not be believed; `None` if nothing speaks against it.
        """
        core = message.core
        if not self._temporary_ids.receive(core.temporary_id, sender):
            return Misbehaviour.IDENTITY
        self._forget(stamp_s)
        known = self._senders.setdefault(sender, _Sender())
        self._senders.move_to_end(sender)
        if len(self._senders) > _SENDERS:
            self._senders.popitem(last=False)
        doubt = _compare(known.last, core, stamp_s)
        is_overtaken = known.last is not None and stamp_s < known.last[0]
        if not is_overtaken:
            known.last = (stamp_s, core)
        if doubt is not None:
            return doubt
        if core.speed_m_s is not None and not is_overtaken:
            known.speeds.append((stamp_s, core.speed_m_s))
        is_braking = message.safety is not None and bool(
            (message.safety.events or 0) & VehicleEventFlags.HARD_BRAKING
        )
        return self._brake_doubt(known, stamp_s) if is_braking else None

    def receive_car_id(self, sender: bytes, car_id: bytes) -> bool:
        """Learn from a group message which sender goes by `car_id` there.

        Returns:
            whether no other sender does. If two do, neither is judged by the other's messages.
        """
        self._car_ids.receive(car_id, sender)
        return not self._car_ids.is_disputed(car_id)

    def check_warning(self, origin_id: bytes, braked_at_s: float) -> Misbehaviour | None:
        """Return why the car `origin_id` cannot have braked hard then; `None`: it can."""
        sender = self._sender_by(origin_id)
        return None if sender is None else self._brake_doubt(sender, braked_at_s)

    def is_heard_since(self, car_id: bytes, stamp_s: float) -> bool:
        """Whether the car has told a speed after `stamp_s`."""
        sender = self._sender_by(car_id)
        return sender is not None and bool(sender.speeds) and sender.speeds[-1][0] > stamp_s

    def _forget(self, stamp_s: float) -> None:
        while self._senders:
            last = next(iter(self._senders.values())).last
            if last is None or stamp_s - last[0] <= FORGOTTEN_S:
                return
            self._senders.popitem(last=False)

    def _sender_by(self, car_id: bytes) -> _Sender | None:
        sender = self._car_ids.owner(car_id)
        return None if sender is None else self._senders.get(sender)

    def _brake_doubt(self, sender: _Sender, at_s: float) -> Misbehaviour | None:
        """Look for two speeds, the later one lower by what a hard brake takes away."""
        near = [(at, speed) for at, speed in sender.speeds if abs(at - at_s) <= BRAKE_WINDOW_S]
        if not self._brakes_must_show or not near or near[-1][0] - near[0][0] < ENOUGH_S:
            return None
        for i, (later_at, later) in enumerate(near):
            for earlier_at, earlier in near[:i]:
                least_m_s = max(BRAKE_DROP_M_S, BRAKE_M_S2 * (later_at - earlier_at))
                if earlier - later >= least_m_s:
                    return None
        return Misbehaviour.BRAKE


def _compare(
    before: tuple[float, CoreData] | None, core: CoreData, stamp_s: float
) -> Misbehaviour | None:
    speed_m_s = core.speed_m_s
    if speed_m_s is not None and speed_m_s > HIGHEST_SPEED_M_S:
        return Misbehaviour.SPEED
    if before is None:
        return None
    elapsed_s = abs(stamp_s - before[0])
    gained_m_s = HIGHEST_ACCELERATION_M_S2 * elapsed_s
    past = before[1]
    if speed_m_s is not None and past.speed_m_s is not None:
        if abs(speed_m_s - past.speed_m_s) > gained_m_s + SPEED_ERROR_M_S:
            return Misbehaviour.ACCELERATION
        fastest_m_s = max(speed_m_s, past.speed_m_s) + gained_m_s / 2
    else:
        fastest_m_s = HIGHEST_SPEED_M_S
    way_m = _way_m(past, core)
    driven_s = elapsed_s + _behind_s(past, before[0], core, stamp_s)
    if way_m is not None and way_m > fastest_m_s * driven_s + POSITION_ERROR_M:
        return Misbehaviour.POSITION
    return None


def _behind_s(past: CoreData, past_at_s: float, core: CoreData, at_s: float) -> float:
    """How much longer the time between the two positions is than that between the messages.

    A car with one fix a second tells each in ten messages, and with the next one it is a second's
    way further on. No more than `OLDEST_POSITION_S` is allowed for that.
    """
    if past.sec_mark_s is None or core.sec_mark_s is None:
        return 0.0
    between_s = math.remainder(core.sec_mark_s - past.sec_mark_s, 60.0)
    return min(max(0.0, between_s - (at_s - past_at_s)), OLDEST_POSITION_S)


def _way_m(one: CoreData, other: CoreData) -> float | None:
    if (
        one.latitude_deg is None
        or one.longitude_deg is None
        or other.latitude_deg is None
        or other.longitude_deg is None
    ):
        return None
    return distance_m(one.latitude_deg, one.longitude_deg, other.latitude_deg, other.longitude_deg)
