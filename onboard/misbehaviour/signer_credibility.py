"""Misbehaviour detection by outcome: may this signer's claim raise an alarm now?

A signature proves who claims, and a plausibility check that the claim is possible; neither proves
that it is true. So an alarm that rests on claims alone is charged to their signers, one unit in
equal shares, and taken back if own sensors confirm it within `CLAIM_S`: they measure the vehicle,
or see the traffic ahead brake. Charges decay. Whoever could not pay for an alarm alone is
ignored: it raises none until its charges have decayed (detection by the receiver itself, ETSI TR
103 460; certificates are its names, so a new one begins anew).

One signer so raises at most `MOST_ALARMS` false alarms, together no longer than that many
`CLAIM_S`, whatever it claims, and then one in 70 minutes. A road-side unit tells many vehicles for
ever of what they do not see: it may raise `MOST_ALARMS_OF_UNIT`.

One vehicle has many certificates at a time. So each signer that stands charged takes one alarm from
all others, and many together raise no more than twice `MOST_ALARMS`, by turns `MOST_ALARMS`. Then
claims need own sensors, or a signer that the host has identified. One signer takes no more than
one: else a single insider would silence all vehicles that own sensors do not see.

Whoever passes on a braking has a second account for that, by the name `PASSING_ON` and its own: it
is not to lose its own credit by what others have told it, nor they theirs by what it makes of it.
All who pass on share `MOST_ALARMS`: the host has identified the one whose word it needs.
"""

import math
from collections import OrderedDict, deque
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import ClassVar

from typing_extensions import override

from onboard.core import Core
from onboard.risk.alarm import RELEASE_S

MOST_ALARMS = 3
"""Alarms of one signer that nothing confirms, before it is ignored."""
MOST_ALARMS_OF_UNIT = 30
"""Of a road-side unit, whose certificate serves for years at one place: more alarms than its
crossing raises in a passage. Ours."""
HALF_LIFE_S = 7200.0
"""In which charges decay by half: a vehicle is ignored for 70 minutes, a unit for 6."""
CAUTION_SHARE = 0.2
"""Of an alarm, by which one that stays at caution level counts against other signers: no sensor
confirms a caution of honest traffic now and then, and hardly ever a warning is not confirmed."""
CLAIM_S = 10.0
"""Time for which an alarm is paid for, and in which it is confirmed: dangers that an alarm tells of
are seconds away."""
SLOWED_M_S = 2.0
"""By which the traffic ahead slows down if a braking ahead is real: half a second of 0.4 g."""
SLOWED_WITHIN_S = 2.0
"""The time in which it does: at 1 m/s^2 at least, by more than traffic varies without a braking."""

PASSING_ON = b"passing on "
"""Before the name of a signer, its account for brakings that it passes on."""

_MAX_SIGNERS = 1024
_MAX_CLAIMS = 256


@dataclass(frozen=True, slots=True)
class SignerIgnored:
    """A signer has raised the most unconfirmed alarms that it may: its claims raise no more."""

    kind: ClassVar[str] = "signer_ignored"
    stamp_s: float
    signer_id: bytes
    """HashedId8 of its certificate, also where it is for what it has passed on."""
    vehicle: str
    """That the last one was about."""


@dataclass(slots=True)
class _Charges:
    """Unconfirmed alarms of one signer."""

    sum: float = 0.0
    """At `at_s`."""
    weighed: float = 0.0
    """The same, but cautions count `CAUTION_SHARE`."""
    at_s: float = 0.0

    def at(self, now: float) -> float:
        """Return what is left of them."""
        return self.sum * self._left(now)

    def counted(self, now: float, most: float) -> float:
        """Return what is left of the weighed ones, which count against others: at most so much."""
        return min(self.weighed * self._left(now), most)

    def add(self, share: float, weighed: float, now: float) -> None:
        """Charge a share of an alarm, or take it back."""
        left = self._left(now)
        self.sum = max(self.sum * left + share, 0.0)
        self.weighed = max(self.weighed * left + weighed, 0.0)
        self.at_s = now

    def _left(self, now: float) -> float:
        return math.exp2(-max(now - self.at_s, 0.0) / HALF_LIFE_S)


@dataclass(slots=True)
class _Claim:
    signers: tuple[bytes, ...]
    """Charged for it in equal shares; none once it is confirmed."""
    asked_at: float
    ends_at: float
    slows_traffic: bool
    weight: float
    """By which it counts against other signers."""

    def lasts(self, now: float) -> bool:
        """Whether its alarm is paid for and on: alarms end after `RELEASE_S`."""
        return now < self.ends_at and now - self.asked_at <= RELEASE_S


class SignerCredibility(Core):
    """Charges of the signers, and the claims that they were charged for lately."""

    def __init__(
        self,
        is_road_side_unit: Callable[[bytes], bool] = lambda _signer: False,
        claim_s: float = CLAIM_S,
    ) -> None:
        """Start without charges.

        Args:
            is_road_side_unit: whether a signer is one.
            claim_s: time for which an alarm is paid for.
        """
        self._is_road_side_unit = is_road_side_unit
        self._claim_s = claim_s
        self._charges: OrderedDict[bytes, _Charges] = OrderedDict()
        self._claims: OrderedDict[tuple[str, str], _Claim] = OrderedDict()
        self._speeds: deque[tuple[float, float]] = deque(maxlen=64)
        """Times and speeds in m/s of the traffic ahead."""
        self._events: deque[SignerIgnored] = deque(maxlen=64)

    def is_ignored(self, signer: bytes, now: float) -> bool:
        """Whether it could not pay for an alarm."""
        charges = self._charges.get(signer)
        if charges is None:
            return False
        most = MOST_ALARMS_OF_UNIT if self._is_road_side_unit(signer) else MOST_ALARMS
        return charges.at(now) + 1.0 > most

    def is_credible(self, signer: bytes, now: float, identified: Collection[bytes] = ()) -> bool:
        """Whether its claim of a braking ahead may raise an alarm; see `admit`."""
        return not self.is_ignored(signer, now) and (
            signer in identified or self._has_allowance(signer, now) or self._has_slowed(now)
        )

    def is_paid(self, vehicle: str, now: float) -> bool:
        """Whether an alarm about this vehicle is on."""
        return any(
            name == vehicle and claim.lasts(now) for (_, name), claim in self._claims.items()
        )

    def admit(
        self,
        alarm: str,
        vehicle: str,
        signers: Collection[bytes],
        now: float,
        *,
        slows_traffic: bool,
        is_warning: bool = True,
        identified: Collection[bytes] = (),
    ) -> bool:
        """Take a claim; return whether it may raise an alarm, or keep it on.

        Who is not ignored pays for it. To be called at 10 Hz while the claim calls for the alarm.
        Who is not identified shares its alarms with all others. Once these are spent, a braking
        ahead raises an alarm when the traffic slows down.

        Args:
            alarm: its cause.
            vehicle: name of the vehicle that it is about.
            signers: who claims it; not empty.
            now: the time.
            slows_traffic: whether the traffic ahead slows down if the claim is true.
            is_warning: whether it calls for an alarm of warning level.
            identified: signers whose vehicles the host has identified.
        """
        weight = 1.0 if is_warning else CAUTION_SHARE
        known = self._claims.get((alarm, vehicle))
        if known is not None and known.lasts(now):
            known.asked_at = now
            self._weigh(known, weight, now)
            return True
        credible = [signer for signer in sorted(signers) if not self.is_ignored(signer, now)]
        payers = [each for each in credible if each in identified or self._has_allowance(each, now)]
        if not payers and not (credible and slows_traffic and self._has_slowed(now)):
            return False
        for signer in payers:
            self._charge(signer, 1.0 / len(payers), weight / len(payers), vehicle, now)
        self._claims[alarm, vehicle] = _Claim(
            tuple(payers),
            now,
            now + self._claim_s,
            slows_traffic,
            weight,
        )
        self._claims.move_to_end((alarm, vehicle))
        if len(self._claims) > _MAX_CLAIMS:
            self._claims.popitem(last=False)
        return True

    def receive_sensed(self, vehicles: Collection[str], now: float) -> None:
        """Take the names of the vehicles that own sensors measure now: claims of them are true."""
        for (_, vehicle), claim in self._claims.items():
            if vehicle in vehicles:
                self._confirm(claim, now)

    def receive_traffic_speed(self, speed_m_s: float, now: float) -> None:
        """Take the speed of the lead by own sensors; without any, the own speed."""
        self._speeds.append((now, speed_m_s))
        if self._has_slowed(now):
            for claim in self._claims.values():
                if claim.slows_traffic:
                    self._confirm(claim, now)

    def receive_other_traffic(self) -> None:
        """Note that the lead is another one now: its speed is not compared with the last one's."""
        self._speeds.clear()

    @override
    def next_event(self) -> SignerIgnored | None:
        """Return the oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def _confirm(self, claim: _Claim, now: float) -> None:
        if now >= claim.ends_at:
            return
        for signer in claim.signers:
            payers = len(claim.signers)
            charges = self._charges.setdefault(signer, _Charges())
            charges.add(-1.0 / payers, -claim.weight / payers, now)
        claim.signers = ()
        claim.ends_at = now + self._claim_s

    def _has_slowed(self, now: float) -> bool:
        """Whether the traffic ahead brakes, or has just braked: its speed varies all the time."""
        recent_m_s = [speed for at, speed in self._speeds if now - at <= SLOWED_WITHIN_S]
        return bool(recent_m_s) and recent_m_s[-1] <= max(recent_m_s) - SLOWED_M_S

    def _has_allowance(self, signer: bytes, now: float) -> bool:
        """Whether what others are charged leaves it an alarm; units share theirs with nobody."""
        if self._is_road_side_unit(signer):
            return True
        own = self._charges.get(signer)
        passes_on = signer.startswith(PASSING_ON)
        others = sum(
            each.counted(now, math.inf if passes_on and name.startswith(PASSING_ON) else 1.0)
            for name, each in self._charges.items()
            if name != signer and not self._is_road_side_unit(name)
        )
        return (0.0 if own is None else own.at(now)) + others + 1.0 <= MOST_ALARMS

    def _weigh(self, claim: _Claim, weight: float, now: float) -> None:
        """Let a claim count as its alarm's highest level."""
        more = max(weight - claim.weight, 0.0)
        claim.weight += more
        for signer in claim.signers if more else ():
            self._charges.setdefault(signer, _Charges()).add(0.0, more / len(claim.signers), now)

    def _charge(
        self, signer: bytes, share: float, weighed: float, vehicle: str, now: float
    ) -> None:
        charges = self._charges.setdefault(signer, _Charges())
        self._charges.move_to_end(signer)
        charges.add(share, weighed, now)
        if self.is_ignored(signer, now):
            self._events.append(SignerIgnored(now, signer.removeprefix(PASSING_ON), vehicle))
        if len(self._charges) > _MAX_SIGNERS:
            self._charges.popitem(last=False)
