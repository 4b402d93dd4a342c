"""Misbehaviour detection: consistency checks of a sender's BSMs (after ETSI TR 103 460).

A valid signature proves who sent a message, not that its content is true. Checked here: a speed is
possible, follows from the speed before, and agrees with the distance between two positions; speeds
show the hard braking that is claimed. Too few data pass.
"""

import math
from collections import OrderedDict, deque
from dataclasses import dataclass, field
from enum import StrEnum

from onboard.kinematics.geodesy import distance_m
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import VehicleEventFlags
from onboard.misbehaviour.identity_claims import IdentityClaims

HIGHEST_SPEED_M_S = 90.0
"""324 km/h, faster than cars drive on roads."""
HIGHEST_ACCELERATION_M_S2 = 12.0
"""Sports tyres on dry road, accelerating or braking."""
SPEED_ERROR_M_S = 1.0
"""Added to every difference: two samples in whole km/h, with some delay."""
MAX_POSITION_AGE_S = 2.0
"""Greatest age of a position in a BSM: receivers with one fix a second, delivered late."""
POSITION_ERROR_M = 20.0
"""Jump of a receiver that leaves a tunnel or changes satellites."""
BRAKE_M_S2 = 2.0
"""Mean deceleration that confirms hard braking: speeds that arrive late show about half of the
0.4 g at which hard braking begins (SAE J2945/1)."""
BRAKE_DROP_M_S = 0.6
"""Least speed difference that confirms braking: more than two steps of a speed in whole km/h."""
BRAKE_WINDOW_S = 2.0
"""Speeds within this time of the braking are compared."""
MIN_SPAN_S = 0.3
"""Speeds over less time than this neither confirm nor contradict braking."""

SENDER_TIMEOUT_S = 60.0
"""Silence after which a sender's earlier messages are dropped."""

MAX_IDS, ID_KEPT_S = 8, 5.0
"""Temporary IDs of one signer in this time: a vehicle changes its ID every few minutes, a road-side
unit may speak for a few persons. Otherwise one certificate is hundreds of vehicles, and the table
of these (`onboard.mvs.footer_validation.MAX_SENDERS`) has no room for a true one."""

_MAX_SENDERS = 512
_MAX_SPEEDS = 32
"""Speeds kept of one sender: three seconds of BSMs."""


class Misbehaviour(StrEnum):
    """The check that failed, as a stable word for counters."""

    SPEED = "implausible_speed"
    ACCELERATION = "implausible_acceleration"
    POSITION = "implausible_position"
    BRAKE = "implausible_brake"
    """Hard braking that the sender's own speeds contradict."""
    IDENTITY = "implausible_identity"
    """One of too many temporary IDs of its signer."""


@dataclass(slots=True)
class _Sender:
    speeds: deque[tuple[float, float, float]] = field(
        default_factory=lambda: deque(maxlen=_MAX_SPEEDS)
    )
    """(received_at_s, stamp_s, speed_m_s)."""
    last: tuple[float, CoreData] | None = None
    ids_used_at: dict[bytes, float] = field(default_factory=dict)
    """Of its temporary IDs, when each was used last."""

    def receive_id(self, temporary_id: bytes, now: float) -> bool:
        """Take a temporary ID at `now`; return whether the sender has not too many."""
        if temporary_id not in self.ids_used_at:
            used_at = self.ids_used_at.items()
            self.ids_used_at = {each: at for each, at in used_at if now - at < ID_KEPT_S}
        is_one_of_few = temporary_id in self.ids_used_at or len(self.ids_used_at) < MAX_IDS
        if is_one_of_few:
            self.ids_used_at[temporary_id] = now
        return is_one_of_few


class MisbehaviourDetector:
    """Recent BSMs of the remote vehicles.

    Stamps are generation times by the sender's clock, so they are compared among those of one
    sender only.
    """

    def __init__(self, *, check_braking: bool = True) -> None:
        """Compare claimed braking with the sender's speeds only if `check_braking`."""
        self._check_braking = check_braking
        self._senders: OrderedDict[bytes, _Sender] = OrderedDict()
        self._car_ids = IdentityClaims(_MAX_SENDERS)
        self._temporary_ids = IdentityClaims(_MAX_SENDERS)

    def receive_bsm(
        self, sender: bytes, message: BasicSafetyMessage, stamp_s: float, now: float
    ) -> Misbehaviour | None:
        """Compare a BSM with the sender's BSMs before it, and keep it.

        A message older than the newest one is compared with it but not kept: backdated messages
        would otherwise replace the sender's history.

        Args:
            sender: the signer's HashedId8, or the temporary ID if messages are not signed.
            message: the BSM.
            stamp_s: its generation time.
            now: time of reception.

        Returns:
            the check that failed; `None` if all passed.
        """
        core = message.core
        self._drop_silent(stamp_s)
        known = self._senders.setdefault(sender, _Sender())
        self._senders.move_to_end(sender)
        if len(self._senders) > _MAX_SENDERS:
            self._senders.popitem(last=False)
        if not known.receive_id(core.temporary_id, now):
            return Misbehaviour.IDENTITY
        violation = _compare(known.last, core, stamp_s)
        is_out_of_order = known.last is not None and stamp_s < known.last[0]
        if not is_out_of_order:
            known.last = (stamp_s, core)
        if violation is not None:
            return violation
        if core.speed_m_s is not None and not is_out_of_order:
            known.speeds.append((now, stamp_s, core.speed_m_s))
        is_braking = message.safety is not None and bool(
            (message.safety.events or 0) & VehicleEventFlags.HARD_BRAKING
        )
        return self._braking_violation(known, now) if is_braking else None

    def remote_id(self, sender: bytes, temporary_id: bytes) -> bytes:
        """Return the name of a remote vehicle: its temporary ID, if it is the first that uses it.

        Whoever uses the ID of another vehicle, even before that vehicle is received, silences
        nobody: the second one is known by ID and signer.

        Args:
            sender: as in `receive_bsm`.
            temporary_id: in its BSM.
        """
        is_first = self._temporary_ids.receive_claim(temporary_id, sender)
        return temporary_id if is_first else temporary_id + sender

    def signer_of(self, remote_id: bytes) -> bytes | None:
        """Return the sender of the remote vehicle that `remote_id` names; `None` if not known."""
        temporary_id, sender = remote_id[:4], remote_id[4:]
        return sender or self._temporary_ids.first(temporary_id)

    def receive_car_id(self, sender: bytes, car_id: bytes) -> bool:
        """Link the communication ID of a group message to its sender.

        Returns:
            whether no other sender uses it. If two do, neither is checked against the other's BSMs.
        """
        self._car_ids.receive_claim(car_id, sender)
        return self.is_id_unique(car_id)

    def owner_of(self, car_id: bytes) -> bytes | None:
        """Return the only sender that uses a communication ID; `None` if there is none, or two."""
        return self._car_ids.owner(car_id)

    def car_id_of(self, sender: bytes) -> bytes | None:
        """Return the communication ID that only this sender uses; `None` if none is known."""
        return self._car_ids.name_of(sender)

    def is_id_unique(self, car_id: bytes) -> bool:
        """Whether at most one sender has used this communication ID."""
        return not self._car_ids.is_disputed(car_id)

    def check_warning(self, origin_id: bytes, braked_at_s: float) -> Misbehaviour | None:
        """Check a warning of car `origin_id` against its speeds; `None` if they allow it.

        Args:
            origin_id: the braking car.
            braked_at_s: when it began, on the own clock.
        """
        sender = self._sender_by(origin_id)
        return None if sender is None else self._braking_violation(sender, braked_at_s)

    def heading_rad(self, sender: bytes) -> float | None:
        """Return the heading in the newest BSM of a sender, clockwise from north."""
        known = self._senders.get(sender)
        return None if known is None or known.last is None else known.last[1].heading_rad

    def has_speed_since(self, car_id: bytes, received_at_s: float, stamp_s: float) -> bool:
        """Whether a BSM with a speed of this car was received and generated after these times.

        Args:
            car_id: its communication ID.
            received_at_s: time on the own clock.
            stamp_s: generation time by that car's clock; minus infinity if not known.
        """
        sender = self._sender_by(car_id)
        if sender is None or not sender.speeds:
            return False
        received_s, generated_s, _ = sender.speeds[-1]
        return received_s > received_at_s and generated_s > stamp_s

    def _drop_silent(self, stamp_s: float) -> None:
        while self._senders:
            last = next(iter(self._senders.values())).last
            if last is None or stamp_s - last[0] <= SENDER_TIMEOUT_S:
                return
            self._senders.popitem(last=False)

    def _sender_by(self, car_id: bytes) -> _Sender | None:
        sender = self._car_ids.owner(car_id)
        return None if sender is None else self._senders.get(sender)

    def _braking_violation(self, sender: _Sender, at_s: float) -> Misbehaviour | None:
        """Look for two speeds, the later one lower by as much as hard braking makes it."""
        near = [(at, speed) for at, _, speed in sender.speeds if abs(at - at_s) <= BRAKE_WINDOW_S]
        if not self._check_braking or not near or near[-1][0] - near[0][0] < MIN_SPAN_S:
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
    max_change_m_s = HIGHEST_ACCELERATION_M_S2 * elapsed_s
    past = before[1]
    if speed_m_s is not None and past.speed_m_s is not None:
        if abs(speed_m_s - past.speed_m_s) > max_change_m_s + SPEED_ERROR_M_S:
            return Misbehaviour.ACCELERATION
        fastest_m_s = max(speed_m_s, past.speed_m_s) + max_change_m_s / 2
    else:
        fastest_m_s = HIGHEST_SPEED_M_S
    travelled_m = _distance_m(past, core)
    between_s = elapsed_s + _behind_s(past, before[0], core, stamp_s)
    if travelled_m is not None and travelled_m > fastest_m_s * between_s + POSITION_ERROR_M:
        return Misbehaviour.POSITION
    return None


def _behind_s(past: CoreData, past_at_s: float, core: CoreData, at_s: float) -> float:
    """Return by how much the time between two positions exceeds that between their messages.

    A car with one fix a second repeats each in ten messages; the next position is then a second's
    distance away. At most `MAX_POSITION_AGE_S` is allowed for that.

    Args:
        past: the earlier BSM.
        past_at_s: its generation time.
        core: the later BSM.
        at_s: its generation time.
    """
    if past.sec_mark_s is None or core.sec_mark_s is None:
        return 0.0
    between_s = math.remainder(core.sec_mark_s - past.sec_mark_s, 60.0)
    return min(max(0.0, between_s - (at_s - past_at_s)), MAX_POSITION_AGE_S)


def _distance_m(one: CoreData, other: CoreData) -> float | None:
    if (
        one.latitude_deg is None
        or one.longitude_deg is None
        or other.latitude_deg is None
        or other.longitude_deg is None
    ):
        return None
    return distance_m(one.latitude_deg, one.longitude_deg, other.latitude_deg, other.longitude_deg)
