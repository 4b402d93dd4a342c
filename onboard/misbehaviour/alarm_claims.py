"""Who claims what an alarm rests on, and whether they are credible.

What own sensors measure is no claim. A remote vehicle is claimed by its signer, a vehicle
without radio by those who measured it and report it themselves, else by those who pass it on, a
braking in the group by the vehicle that signed it. Whoever repeats that claims only what the
signature leaves open: that the braking is ahead in this group. A test of the brake button claims
nothing, so each vehicle's are shown for `TEST_S` in `TEST_EVERY_S`.
"""

import math
from collections import Counter, OrderedDict
from collections.abc import Callable, Collection, Iterable, Sequence

from onboard.core import Core
from onboard.lcca.events import WarningLevel, WarningRaised
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.lcca import CarId, Warn
from onboard.misbehaviour.signer_credibility import PASSING_ON, SignerCredibility
from onboard.observations import BrakeCause, Lead
from onboard.risk.alarm import Assessment, Cause, Level
from onboard.risk.alarm_table import Credit, row_of
from onboard.sensors.host_state import HostState
from onboard.tracking.evidence import observers_of
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

MAX_SIGMA_M_S = 1.0
"""Of a closing speed that shows the lead vehicle slowing down."""

NOBODY = b""
"""The signer of a braking that too many others have displaced: all of these together raise as many
false alarms as one signer."""
NO_SENDER = b"no sender"
"""The same of vehicles whose BSMs are not known."""
TEST_S, TEST_EVERY_S = 2.0, 20.0
"""A button sends its test for a second."""
_MAX_TESTS = 64
_MAX_BRAKINGS = 256
"""Of more, the oldest of whoever has claimed most is displaced: nobody displaces another's."""


class AlarmClaims:
    """Asks for each alarm that rests on claims whether their signers are credible."""

    def __init__(
        self,
        signer_of: Callable[[bytes], bytes | None],
        is_road_side_unit: Callable[[bytes], bool],
        host: HostState,
        *,
        has_sight: bool,
    ) -> None:
        """Start without claims.

        Args:
            signer_of: the signer of a remote vehicle's BSMs, by temporary ID.
            is_road_side_unit: whether a signer is one.
            host: the host vehicle by its sensors, filled by the caller.
            has_sight: whether a sensor looks ahead. Without, the host's own slowing down confirms
                an alarm.
        """
        self.credibility = SignerCredibility(is_road_side_unit)
        self._accounts = {
            Credit.SHARED: self.credibility,
            Credit.OWN: SignerCredibility(is_road_side_unit),
            # Paid for until it is over: who waits for a gap signals on beside an honest vehicle.
            Credit.UNCONFIRMED: SignerCredibility(is_road_side_unit, math.inf),
        }
        self._signer_of = signer_of
        self._has_sight = has_sight
        self._host = host
        self._identified: Collection[bytes] = ()
        self._lead_track: int | None = None
        self._objects: dict[str, PerceivedObject] = {}
        self._first_signers: OrderedDict[tuple[CarId, int], bytes] = OrderedDict()
        """First claimant of each braking, by its vehicle and first sequence number."""
        self._brakings: OrderedDict[str, bytes] = OrderedDict()
        """Claimant of the last one of each vehicle, by the name that alarms have for it."""
        self._tested_at: OrderedDict[str, float] = OrderedDict()
        """Start of the last test that was shown, by the same name."""

    @property
    def cores(self) -> Iterable[Core]:
        """Those whose events are put out."""
        return self._accounts.values()

    def receive_identified(self, signers: Collection[bytes]) -> None:
        """Take the signers of the vehicles that the host has identified; replaces the last ones."""
        self._identified = {*signers, *(PASSING_ON + each for each in signers)}

    def claimant(self, forwarder: bytes, origin: bytes | None, now: float) -> bytes:
        """Return whose account a braking is charged to that `forwarder` passes on.

        The braking vehicle's, if it stated itself that it is ahead. While strangers raise no alarm,
        an identified vehicle vouches for one whose braking it passes on.

        Args:
            forwarder: who signed the copy.
            origin: signer of the statement in it; `None` if it does not say that it is ahead.
            now: the time.
        """
        passing_on = PASSING_ON + forwarder
        if origin is None:
            return passing_on
        lacks_alarms = not self.credibility.is_credible(origin, now, self._identified)
        vouches = passing_on in self._identified and not self.credibility.is_ignored(origin, now)
        return passing_on if lacks_alarms and vouches else origin

    def receive_warn(self, warn: Warn, claimant: bytes | None, now: float) -> None:
        """Take a warning on the air that the group is given next; `claimant` claims the braking."""
        braking, name = (warn.event_origin_id, warn.first_sequence), warn.event_origin_id.hex()
        first = self._first_signers.get(braking, NOBODY)
        if first == NOBODY or self.is_refused(name, first, now):
            self._first_signers[braking] = claimant or NOBODY
        if self._brakings.get(name) == first:
            self._brakings[name] = self._first_signers[braking]
        if len(self._first_signers) > _MAX_BRAKINGS:
            ((most, _),) = Counter(self._first_signers.values()).most_common(1)
            del self._first_signers[
                next(each for each, of in self._first_signers.items() if of == most)
            ]

    def receive_warning(self, warning: WarningRaised | WarningLevel) -> None:
        """Take a warning, or a new level of it, of which the group tells the driver."""
        name = warning.origin_id.hex()
        if warning.cause is BrakeCause.TEST:
            self._brakings.pop(name, None)
            return
        key = warning.origin_id, warning.sequence
        self._brakings[name] = self._first_signers.get(key, NOBODY)
        self._brakings.move_to_end(name)
        if len(self._brakings) > _MAX_BRAKINGS:
            self._brakings.popitem(last=False)

    def receive_speed(self, speed_m_s: float, now: float) -> None:
        """Take a sample of the host vehicle's speed."""
        if not self._has_sight:
            self._receive_traffic_speed(speed_m_s, now)

    def receive_lead(self, lead: Lead, now: float) -> None:
        """Take an observation of the lead vehicle, for its speed."""
        sigma_m_s = lead.closing_speed_sigma_m_s
        if lead.track_id not in (None, self._lead_track):
            self._lead_track = lead.track_id
            for account in self._confirmed:
                account.receive_other_traffic()
        speed, closing_m_s = self._host.speed(now), lead.closing_speed_m_s
        if speed is not None and closing_m_s is not None and (sigma_m_s or 0.0) <= MAX_SIGMA_M_S:
            self._receive_traffic_speed(speed.speed_m_s - closing_m_s, now)

    def alarming(self, objects: Sequence[PerceivedObject], now: float) -> list[PerceivedObject]:
        """Return the perceived objects but those that only ignored signers claim."""
        self._objects = {each.name: each for each in objects}
        sensed = {each.name for each in objects if each.is_sensed}
        for account in self._confirmed:
            account.receive_sensed(sensed, now)
        return [each for each in objects if self._may_alarm(each, now)]

    def admit(self, cause: Cause, assessment: Assessment, now: float) -> bool:
        """Take an assessment; return whether it may raise an alarm, or keep it on."""
        if assessment.is_test:
            shown = [self._admit_test(reason.name, now) for reason in assessment.reasons]
            return all(shown)
        row = row_of(cause)
        slows_traffic = row.slows_traffic or not self._has_sight
        account = self._accounts[row.credit]
        for what, name in dict.fromkeys((each.what, each.name) for each in assessment.reasons):
            signers = self._claimants(name, is_bsm=what == BasicSafetyMessage.kind)
            if signers and not account.admit(
                cause,
                name,
                signers,
                now,
                slows_traffic=slows_traffic,
                is_warning=assessment.level is Level.WARNING,
                # In their own account signers are to spend no alarms of others.
                identified=self._identified if row.credit is Credit.SHARED else signers,
            ):
                return False
        return True

    @property
    def _confirmed(self) -> tuple[SignerCredibility, ...]:
        return self.credibility, self._accounts[Credit.OWN]

    def _receive_traffic_speed(self, speed_m_s: float, now: float) -> None:
        for account in self._confirmed:
            account.receive_traffic_speed(speed_m_s, now)

    def _admit_test(self, name: str, now: float) -> bool:
        began_at = self._tested_at.get(name, -math.inf)
        if now >= began_at + TEST_EVERY_S:
            self._tested_at[name] = began_at = now
            self._tested_at.move_to_end(name)
        if len(self._tested_at) > _MAX_TESTS:
            self._tested_at.popitem(last=False)
        return now < began_at + TEST_S

    def is_ignored(self, name: str, signers: Iterable[bytes], now: float) -> bool:
        """Whether what only these signers claim raises no alarm; one that is on goes on."""
        return all(
            self.credibility.is_ignored(one, now) for one in signers
        ) and not self.credibility.is_paid(name, now)

    def is_refused(self, name: str, signer: bytes, now: float) -> bool:
        """Whether a warning of a braking, as this signer claims it, raises no alarm."""
        is_credible = self.credibility.is_credible(signer, now, self._identified)
        return not is_credible and not self.credibility.is_paid(name, now)

    def _may_alarm(self, each: PerceivedObject, now: float) -> bool:
        ids = _claiming_ids(each)
        return not ids or not self.is_ignored(each.name, map(self._signer_or_nobody, ids), now)

    def _claimants(self, name: str, *, is_bsm: bool = False) -> frozenset[bytes]:
        """Return who claims a braking or a vehicle; nobody, if own sensors measure it.

        Args:
            name: of the vehicle.
            is_bsm: whether its BSM claims it; without a position it is no perceived object.
        """
        claimed = self._objects.get(name)
        if claimed is None and is_bsm:
            return frozenset({self._signer_or_nobody(bytes.fromhex(name))})
        if claimed is None:
            return frozenset({self._brakings[name]} if name in self._brakings else ())
        return frozenset(map(self._signer_or_nobody, _claiming_ids(claimed)))

    def _signer_or_nobody(self, temporary_id: bytes) -> bytes:
        return self._signer_of(temporary_id) or NO_SENDER


def _claiming_ids(claimed: PerceivedObject) -> frozenset[bytes]:
    """Return the temporary IDs of those who claim a vehicle; none, if own sensors measure it."""
    if claimed.is_sensed:
        return frozenset()
    if claimed.source is ObjectSource.BSM:
        return frozenset({bytes.fromhex(claimed.name)})
    return claimed.reporters & observers_of(claimed.provenance) or claimed.reporters
