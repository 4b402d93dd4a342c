"""Membership in the predecessor's group: join, refresh, reply, leave.

Membership is soft state: a join is repeated until it is answered, an answered join is refreshed,
and what is not refreshed expires. The BSMs that both vehicles send anyway show that they are still
there, so while they arrive a join is refreshed only as often as the leader's sequence number needs
it. While the camera identifies another vehicle than the predecessor,
that one is sent joins, and the old membership lasts as long as `lead_hold_s` allows: no vehicle
answers to a misread plate, and the next frames show the right one again.
"""

import math
from collections import deque
from collections.abc import Iterable, Mapping

import numpy as np

from onboard.lcca.forwarding import EventId
from onboard.lcca.lead_monitor import LeadMonitor
from onboard.lcca.parameters import GroupParameters
from onboard.messages.lcca import NO_ID, CarId, Join, LeaveReason, Reply

_NEVER = float("-inf")
_SEQUENCES = 1 << 16
_NO_EVENT: EventId = (NO_ID, 0)
_MAX_ACKNOWLEDGEMENTS = 8
"""Acknowledgements waiting to be sent; the oldest is dropped, and its warning repeated."""
_MAX_DOUBLINGS = 16
_LAG_S = 0.25
"""By which a vehicle behind the first follower refreshes later: the reply to its predecessor, which
tells it to join, comes before that, also if it is lost once."""


class Membership:
    """The predecessor, the candidate that is sent joins, and when the next join is due."""

    def __init__(
        self, parameters: GroupParameters, lead_monitor: LeadMonitor, rng: np.random.Generator
    ) -> None:
        """Start without a predecessor.

        Args:
            parameters: times and limits of the warning group.
            lead_monitor: knows the lead and how close it is.
            rng: draws the first sequence number and the spread of joins.
        """
        self._parameters = parameters
        self._lead_monitor = lead_monitor
        self._rng = rng
        self.predecessor: CarId | None = None
        """The lead vehicle that this one follows."""
        self._candidate: CarId | None = None
        """Another vehicle that is sent joins."""
        self._unanswered = 0
        self._join_at = 0.0
        self._sequence = int(rng.integers(_SEQUENCES))
        self._answered_sequence = self._sequence
        self._answered_at = self._bsm_at = _NEVER
        self._sequence_at = _NEVER
        self._refresh_by = _NEVER
        """Until then BSMs may put the next join off; in the past if it is no refresh."""
        self._to_acknowledge: deque[EventId] = deque(maxlen=_MAX_ACKNOWLEDGEMENTS)

    def follows(self, car_id: CarId) -> bool:
        """Whether that vehicle is the predecessor."""
        return car_id == self.predecessor

    def receive_frame(self, own_id: CarId, now: float) -> None:
        """Update the candidate after a frame that the lead monitor has received."""
        wanted = self._lead_monitor.lead_to_join(now)
        if wanted == own_id:
            wanted = None
        candidate = self._candidate
        if candidate is not None and (
            self._lead_monitor.identified != candidate or self._lead_monitor.is_far(candidate)
        ):
            self._set_candidate(None, now)
        if wanted is not None and wanted not in (self._candidate, self.predecessor):
            self._set_candidate(wanted, now)

    def _set_candidate(self, car_id: CarId | None, now: float) -> None:
        self._candidate = car_id
        self._unanswered = 0
        self.join_at_once(now)

    def next_join(self, header: tuple[CarId, CarId, int], now: float) -> Join | None:
        """Return a join that is due, under the own ID, leader and number; plan the next one."""
        if self._candidate is not None and now >= self._close_until(self._candidate):
            self._set_candidate(None, now)
        to_id = self._candidate if self._candidate is not None else self.predecessor
        if to_id is None or now < self._join_at:
            return None
        wait_s = self._parameters.retry_s
        if self._candidate is not None:
            wait_s = min(wait_s * 2**self._unanswered, self._parameters.retry_max_s)
        self._unanswered = min(self._unanswered + 1, _MAX_DOUBLINGS)
        self._join_at, self._refresh_by = now + wait_s + self._spread(), _NEVER
        self._sequence = (self._sequence + 1) % _SEQUENCES
        acknowledged = self._to_acknowledge.popleft() if self._to_acknowledge else _NO_EVENT
        if self._to_acknowledge:
            self.join_soon(now)
        return Join(*header, to_id, self._sequence, *acknowledged)

    def acknowledge(self, events: Iterable[EventId], now: float, *, at_once: bool = False) -> None:
        """Name these warnings in the next joins, and advance the first of these."""
        self._to_acknowledge.extend(each for each in events if each not in self._to_acknowledge)
        if at_once:
            self.join_at_once(now)
        else:
            self.join_soon(now)

    def join_soon(self, now: float) -> None:
        """Advance the next join to a random moment within `spread_s`."""
        self._join_at, self._refresh_by = min(self._join_at, now + self._spread()), _NEVER

    def change_sequence(self) -> None:
        """Number joins anew; replies to earlier ones are outdated."""
        self._sequence = self._answered_sequence = int(self._rng.integers(_SEQUENCES))

    def join_at_once(self, now: float) -> None:
        """Advance the next join to now."""
        self._join_at, self._refresh_by = now, _NEVER

    def receive_predecessor_reply(self, now: float, *, moved: bool, newer: bool) -> None:
        """Take a reply to the predecessor: refresh at once if it moves by it, soon if it has news.

        If the predecessor has lost the reply, it has the news only after `retry_s`.

        Args:
            now: seconds on the cores' clock.
            moved: whether the predecessor's leader or number will change by it.
            newer: whether it carries a newer leader sequence number.
        """
        has_bsms = now < self._bsm_at + self._parameters.refresh_s
        usual_s = self._parameters.bsm_refresh_s if has_bsms else self._parameters.refresh_s
        if moved:
            self.join_soon(now)
        elif newer and now - self._sequence_at >= usual_s / 2:
            self.join_soon(now + self._parameters.retry_s if has_bsms else now)

    def receive_bsm(self, car_id: CarId, now: float) -> None:
        """Take that a BSM of this vehicle has arrived: the predecessor's put the refresh off."""
        if car_id != self.predecessor:
            return
        self._bsm_at = now
        if now < self._refresh_by:
            put_off_to = max(self._join_at, now + self._parameters.refresh_s)
            self._join_at = min(put_off_to, self._refresh_by)

    def refusal(self, reply: Reply, now: float) -> str | None:
        """Return why a reply is refused, as a counted word, or `None` if it is accepted."""
        if reply.sender_id not in (self._candidate, self.predecessor):
            return "not_asked"
        ahead = (reply.sequence - self._answered_sequence) % _SEQUENCES
        if not 0 < ahead <= (self._sequence - self._answered_sequence) % _SEQUENCES:
            return "stale"
        if not self._lead_monitor.matches_speed(reply.speed_m_s, now):
            return "implausible"
        return None

    def receive_reply(self, reply: Reply, *, newer: bool, now: float) -> None:
        """Take an accepted reply of the predecessor or of the candidate, which becomes it.

        Args:
            reply: the reply.
            newer: whether it carries a newer leader sequence number.
            now: seconds on the cores' clock.
        """
        self._answered_sequence = reply.sequence
        self._answered_at = now
        if newer or reply.sender_id != self.predecessor:
            self._sequence_at = now
        if reply.sender_id != self.predecessor:
            self.predecessor, self._candidate, self._bsm_at = reply.sender_id, None, _NEVER
        if self._candidate is None:
            self._unanswered = 0
            after_s = self._parameters.bsm_refresh_s + (_LAG_S if reply.number > 1 else 0.0)
            by = max(self._sequence_at + after_s, now + self._parameters.retry_s)
            spread_s = self._spread()
            self._refresh_by = by + spread_s
            self._join_at = min(now + self._parameters.refresh_s, by) + spread_s
        if self._to_acknowledge:
            self.join_soon(now)

    def receive_leader_sequence(self, now: float) -> None:
        """Take a newer leader sequence number from a vehicle ahead."""
        self._sequence_at = now

    def expire(self, now: float) -> LeaveReason | None:
        """Return why the membership has ended, or `None`."""
        if self.predecessor is None:
            return None
        if now >= self._close_until(self.predecessor):
            if self._lead_monitor.speed_at(now) is None:
                return LeaveReason.SPEED_UNKNOWN
            far = self._lead_monitor.is_far(self.predecessor)
            return LeaveReason.GAP if far else LeaveReason.NOT_AHEAD
        if now >= self._answered_until:
            return LeaveReason.NO_ANSWER
        if now >= self._sequence_at + self._parameters.leader_silence_s:
            return LeaveReason.LEADER_SILENT
        return None

    def leave(self, now: float) -> None:
        """Follow no vehicle. If the former predecessor stays too close, it is sent joins again."""
        if self._candidate is None and self._lead_monitor.identified == self.predecessor:
            self._set_candidate(None, now)
        self.predecessor = None

    def rename(self, names: Mapping[CarId, CarId]) -> None:
        """Take the new IDs of vehicles, by the old ones."""
        if self.predecessor is not None:
            self.predecessor = names.get(self.predecessor, self.predecessor)
        if self._candidate is not None:
            self._candidate = names.get(self._candidate, self._candidate)

    def get_timer(self) -> float:
        """When a join is due or the membership may end; infinite without either."""
        if self.predecessor is None:
            return math.inf if self._candidate is None else self._join_at
        return min(
            self._join_at,
            self._close_until(self.predecessor),
            self._answered_until,
            self._sequence_at + self._parameters.leader_silence_s,
        )

    @property
    def _answered_until(self) -> float:
        """Until when the predecessor counts as there."""
        return min(
            max(self._answered_at, self._bsm_at) + self._parameters.membership_lifetime_s,
            self._answered_at + self._parameters.join_lifetime_s,
        )

    def _close_until(self, car_id: CarId) -> float:
        """Until when that vehicle counts as close after the last frame that showed it so."""
        return self._lead_monitor.close_at(car_id) + self._parameters.lead_hold_s

    def _spread(self) -> float:
        return float(self._rng.uniform(0.0, self._parameters.spread_s))
