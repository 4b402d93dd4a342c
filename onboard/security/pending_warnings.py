"""Warnings of a group, held against the speeds that the braking car tells in its BSMs.

A warning comes first, and the BSM that shows the brake a moment later. So a warning that the
speeds heard so far bear out, or cannot judge, passes at once. One that they speak against is held
until the car's next BSM bears it out, and passes late rather than never when no further BSM comes.
Only a car that is heard driving on as before is disbelieved.
"""

import math
from collections import deque
from dataclasses import dataclass, replace

from onboard.messages.lcca import Warn
from onboard.observations import Discarded
from onboard.security.misbehaviour_detection import MisbehaviourDetector

HOLD_S = 0.25
"""Two BSMs at 10 Hz come in this time, should one be lost."""
MOST = 64
"""Doubtful warnings held at a time; whoever floods the air with more is not believed."""


@dataclass(frozen=True, slots=True)
class _Pending:
    message: Warn
    made_at_s: float
    since_s: float

    def aged(self, now: float) -> Warn:
        """A message cannot count the time that it was on its way or held."""
        return replace(self.message, age_s=self.message.age_s + max(0.0, now - self.made_at_s))


class PendingWarnings:
    """Asks `plausibility` about each warning, now and while it is held."""

    def __init__(self, plausibility: MisbehaviourDetector) -> None:
        self._plausibility = plausibility
        self._held: deque[_Pending] = deque()
        self._passed: deque[Warn] = deque()
        self._events: deque[Discarded] = deque()

    def receive_warning(self, message: Warn, made_at_s: float, now: float) -> None:
        """Take a warning that is authentic; `next_warning` has it now, later or never."""
        self._held.append(_Pending(message, made_at_s, now))
        self.handle_timer(now)
        if len(self._held) > MOST:
            self._disbelieve(self._held.pop(), "too_many_warnings", now)

    def next_warning(self) -> Warn | None:
        """The next warning that passed; `None` when there is none."""
        return self._passed.popleft() if self._passed else None

    def next_event(self) -> Discarded | None:
        """The next warning that was not believed, and why."""
        return self._events.popleft() if self._events else None

    def get_timer(self) -> float:
        """Return when the oldest pending warning must be decided; `math.inf` without one."""
        return self._held[0].since_s + HOLD_S if self._held else math.inf

    def handle_timer(self, now: float) -> None:
        """Look again at all that are held: after each BSM, and when the time is over."""
        waiting: deque[_Pending] = deque()
        for held in self._held:
            origin = held.message.event_origin_id
            braked_at_s = held.made_at_s - held.message.age_s
            doubt = self._plausibility.check_warning(origin, braked_at_s)
            if doubt is None:
                self._passed.append(held.aged(now))
            elif now < held.since_s + HOLD_S:
                waiting.append(held)
            elif self._plausibility.is_heard_since(origin, held.made_at_s):
                self._disbelieve(held, doubt, now)
            else:
                self._passed.append(held.aged(now))
        self._held = waiting

    def _disbelieve(self, held: _Pending, reason: str, now: float) -> None:
        origin = held.message.event_origin_id.hex()
        self._events.append(Discarded(now, "lcca", reason, f"a brake of {origin}"))
