"""Our side of following the car ahead: joining, refreshing, believing, leaving.

Soft state: a join is repeated until it is answered, an answered one is refreshed, and what is not
refreshed expires. While the camera names another car than the one we follow, that one is asked, and
the old membership stays for as long as `lead_hold_s` allows: a misread plate answers to nobody, and
the next frames show the right one again.
"""

import math

import numpy as np

from onboard.lcca.lead_monitor import LeadMonitor
from onboard.lcca.settings import LccaSettings
from onboard.messages.lcca import CarId, LeaveReason, Reply

_NEVER = float("-inf")
_SEQUENCES = 1 << 16
_MOST_DOUBLINGS = 16


class Membership:
    """Who is followed, who is asked, and when the next join is due."""

    def __init__(
        self, settings: LccaSettings, lookout: LeadMonitor, rng: np.random.Generator
    ) -> None:
        self._settings = settings
        self._lookout = lookout
        self._rng = rng
        self.predecessor: CarId | None = None
        """The car that this one follows."""
        self._asked: CarId | None = None
        """Another car that the camera wants joined."""
        self._unanswered = 0
        self._join_at = 0.0
        self._sequence = int(rng.integers(_SEQUENCES))
        self._answered_sequence = self._sequence
        self._answered_at = _NEVER
        self._news_at = _NEVER
        self._renaming_until = _NEVER

    def receive_frame(self, own_ids: tuple[CarId, ...], now: float) -> None:
        """Follow the camera: ask the car that it wants joined, stop asking one it lost."""
        wanted = self._lookout.to_join(now)
        if wanted is not None and wanted in own_ids:
            wanted = None
        asked = self._asked
        if asked is not None and (self._lookout.named != asked or self._lookout.shows_far(asked)):
            self._ask(None, now)
        if wanted is not None and wanted not in (self._asked, self.predecessor):
            self._ask(wanted, now)

    def _ask(self, car_id: CarId | None, now: float) -> None:
        self._asked = car_id
        self._unanswered = 0
        self._join_at = now

    def next_join(self, now: float) -> tuple[CarId, int] | None:
        """Return whom to send a join now, and its sequence number; plan its repetition."""
        if self._asked is not None and now >= self._shown_until(self._asked):
            self._ask(None, now)
        to_id = self._asked if self._asked is not None else self.predecessor
        if to_id is None or now < self._join_at:
            return None
        wait_s = self._settings.retry_s
        if self._asked is not None:
            wait_s = min(wait_s * 2**self._unanswered, self._settings.retry_max_s)
        self._unanswered = min(self._unanswered + 1, _MOST_DOUBLINGS)
        self._join_at = now + wait_s + self._spread()
        self._sequence = (self._sequence + 1) % _SEQUENCES
        return to_id, self._sequence

    def join_soon(self, now: float) -> None:
        """Bring the next join forward, but not to where others send theirs."""
        self._join_at = min(self._join_at, now + self._spread())

    def join_at_once(self, now: float) -> None:
        """Bring the next join forward to now."""
        self._join_at = now

    def hear_predecessor_refresh(self, now: float, *, moved: bool, news: bool) -> None:
        """The car ahead was answered: ask it in turn, if it moved or we had no news for long."""
        if moved or (news and now - self._news_at >= self._settings.refresh_s / 2):
            self.join_soon(now)

    def refusal(self, reply: Reply, now: float) -> str | None:
        """Return why a reply is not believed, as a reason word, or `None` if it is."""
        if reply.sender_id not in (self._asked, self.predecessor):
            return "not_asked"
        ahead = (reply.sequence - self._answered_sequence) % _SEQUENCES
        if not 0 < ahead <= (self._sequence - self._answered_sequence) % _SEQUENCES:
            return "stale"
        if not self._lookout.fits(reply.speed_m_s, now):
            return "implausible"
        return None

    def receive_reply(self, reply: Reply, *, news: bool, now: float) -> None:
        """A believed answer of the car that we follow or, from now on, follow."""
        self._answered_sequence = reply.sequence
        self._answered_at = now
        if news or reply.sender_id != self.predecessor:
            self._news_at = now
        if reply.sender_id != self.predecessor:
            self.predecessor, self._asked = reply.sender_id, None
        if self._asked is None:
            self._unanswered = 0
            self._join_at = now + self._settings.refresh_s + self._spread()

    def receive_news(self, now: float) -> None:
        """The leader lives, says somebody ahead."""
        self._news_at = now

    def lapse(self, now: float) -> LeaveReason | None:
        """Return why the membership is over, if it is."""
        if self.predecessor is None:
            return None
        if now >= self._shown_until(self.predecessor):
            if self._lookout.speed_at(now) is None:
                return LeaveReason.SPEED_UNKNOWN
            far = self._lookout.shows_far(self.predecessor)
            return LeaveReason.GAP if far else LeaveReason.NOT_AHEAD
        if now >= self._answered_at + self._settings.membership_lifetime_s:
            return LeaveReason.NO_ANSWER
        if now >= self._news_at + self._settings.leader_silence_s:
            return LeaveReason.LEADER_SILENT
        return None

    def leave(self, now: float) -> None:
        """Follow nobody. If the camera still wants that car, it is asked again by and by."""
        if self._asked is None and self._lookout.named == self.predecessor:
            self._ask(None, now)
        self.predecessor = None

    def rename(self, now: float) -> None:
        """All cars change their IDs about now: another plate's digest may be the same plate."""
        self._renaming_until = now + self._settings.rename_s
        self.join_soon(now)

    def get_timer(self) -> float:
        """Return when a join is due or the membership may end; `math.inf` for neither."""
        if self.predecessor is None:
            return math.inf if self._asked is None else self._join_at
        return min(
            self._join_at,
            self._shown_until(self.predecessor),
            self._answered_at + self._settings.membership_lifetime_s,
            self._news_at + self._settings.leader_silence_s,
        )

    def _shown_until(self, car_id: CarId) -> float:
        """How long what the camera has shown of that car is good for."""
        close_at = self._lookout.close_at(car_id)
        if self._lookout.last_close_at < self._renaming_until:
            close_at = max(close_at, self._lookout.last_close_at)
        return close_at + self._settings.lead_hold_s

    def _spread(self) -> float:
        return float(self._rng.uniform(0.0, self._settings.spread_s))
