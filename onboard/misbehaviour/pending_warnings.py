"""LCCA warnings that wait until the BSM speeds of the braking car confirm them.

A warning arrives before the BSM that shows the braking. A warning that the speeds so far confirm,
or that cannot be checked, passes at once. One that they contradict is pending until the car's next
BSM confirms it. If no BSM arrives in `HOLD_S`, it passes late; if BSMs arrive and still contradict
it, it is rejected. That a braking is over, and a test, are not checked.

The age of a warning grows by what each vehicle holds it, and by `AIR_S` for each transmission: no
two clocks are compared. Generation times, which are compared, only bound how long an attacker may
have kept a copy.
"""

import math
from collections import Counter, deque
from dataclasses import dataclass, replace

from typing_extensions import override

from onboard.core import Core
from onboard.messages.lcca import Warn, WarnCause
from onboard.misbehaviour.misbehaviour_detection import MisbehaviourDetector
from onboard.observations import Discarded

HOLD_S = 0.25
"""Time for two BSMs at 10 Hz, so that one may be lost."""
AIR_S = 0.001
"""Age added for a transmission: a message of 300 bytes takes 0.4 ms at 6 Mbit/s (IEEE 802.11p), and
waits for the channel."""
FRESH_S = 3.0
"""Largest difference between generation and reception: clocks that differ by 2 s, and a second."""
MAX_PENDING = 64
"""Warnings pending at a time, a bound on memory. Of more, the last one of whoever has most is
rejected."""


@dataclass(frozen=True, slots=True)
class _Pending:
    message: Warn
    signer: bytes | None
    made_at_s: float
    since_s: float

    def aged(self, now: float) -> Warn:
        """Return the warning with the times on the air and pending added to its age."""
        return replace(self.message, age_s=self.message.age_s + AIR_S + (now - self.since_s))


class PendingWarnings(Core):
    """Checks each warning with the misbehaviour detector, at once and while it is pending."""

    def __init__(self, misbehaviour: MisbehaviourDetector) -> None:
        self._misbehaviour = misbehaviour
        self._pending: deque[_Pending] = deque()
        self._passed: deque[tuple[Warn, bytes | None]] = deque()
        self._events: deque[Discarded] = deque()

    def receive_warning(
        self, message: Warn, signer: bytes | None, made_at_s: float, now: float
    ) -> None:
        """Take a warning of verified origin; `next_warning` returns it once it passes.

        Args:
            message: the warning.
            signer: who signed this copy of it; `None` if it is not signed.
            made_at_s: its generation time by its sender's clock.
            now: the present time.
        """
        if abs(now - made_at_s) > FRESH_S:
            self._reject(_Pending(message, signer, made_at_s, now), "stale", now)
            return
        self._pending.append(_Pending(message, signer, made_at_s, now))
        self.handle_timer(now)
        if len(self._pending) > MAX_PENDING:
            ((most, _),) = Counter(each.signer for each in self._pending).most_common(1)
            last = next(each for each in reversed(self._pending) if each.signer == most)
            self._pending.remove(last)
            self._reject(last, "too_many_warnings", now)

    def next_warning(self) -> tuple[Warn, bytes | None] | None:
        """Return the next warning that passed, and its signer; `None` if there is none."""
        return self._passed.popleft() if self._passed else None

    @override
    def next_event(self) -> Discarded | None:
        """Return the next rejected warning, with the reason."""
        return self._events.popleft() if self._events else None

    @override
    def get_timer(self) -> float:
        """Return when the oldest pending warning must be decided; `math.inf` without one."""
        return self._pending[0].since_s + HOLD_S if self._pending else math.inf

    @override
    def handle_timer(self, now: float) -> None:
        """Check all pending warnings again: after each BSM, and when their time is over."""
        waiting: deque[_Pending] = deque()
        for pending in self._pending:
            violation = self._violation(pending)
            if violation is None:
                self._passed.append((pending.aged(now), pending.signer))
            elif now < pending.since_s + HOLD_S:
                waiting.append(pending)
            elif self._has_speed_since(pending):
                self._reject(pending, violation, now)
            else:
                self._passed.append((pending.aged(now), pending.signer))
        self._pending = waiting

    def _violation(self, pending: _Pending) -> str | None:
        message = pending.message
        if message.cause in (WarnCause.OVER, WarnCause.TEST):
            return None
        return self._misbehaviour.check_warning(
            message.event_origin_id, pending.since_s - message.age_s
        )

    def _has_speed_since(self, pending: _Pending) -> bool:
        """Whether the braking vehicle's speed is known from after the warning."""
        message = pending.message
        is_direct = message.sender_id == message.event_origin_id
        return self._misbehaviour.has_speed_since(
            message.event_origin_id, pending.since_s, pending.made_at_s if is_direct else -math.inf
        )

    def _reject(self, pending: _Pending, reason: str, now: float) -> None:
        origin = pending.message.event_origin_id.hex()
        self._events.append(Discarded(now, "lcca", reason, f"a brake of {origin}"))
