"""What the signals of one intersection show, and until when, from a SPAT message."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

from onboard.errors import DecodeError
from onboard.messages.lanes import PERMANENTLY_GREEN, UNKNOWN_SIGNAL_GROUP
from onboard.messages.spat import (
    HOUR_S,
    IntersectionState,
    IntersectionStatus,
    MovementPhaseState,
    MovementState,
    TimeChangeDetails,
)

MAX_ENDED_S = 600.0
"""A TimeMark up to this time before the message is in the past; any other one is in the next hour,
since it names no hour."""
END_TOLERANCE_S = 0.5
"""A controller repeats the end of a phase for some cycles of its message after it has passed."""

DARK = (
    IntersectionStatus.FAILURE_FLASH
    | IntersectionStatus.FAILURE_MODE
    | IntersectionStatus.OFF
    | IntersectionStatus.NO_VALID_SPAT_IS_AVAILABLE_AT_THIS_TIME
)
"""Status with which the signals tell nothing. Controllers in operation report that they have no
MAP; here, the revision decides whether there is one."""


@dataclass(frozen=True, slots=True)
class SignalPhase:
    """What a signal shows; times are those left from the message on, `None` if unknown."""

    state: MovementPhaseState
    min_left_s: float | None
    max_left_s: float | None
    likely_left_s: float | None

    def after(self, elapsed_s: float) -> "SignalPhase | None":
        """Return the phase as it is later; `None` if it has ended by then."""
        if self.max_left_s is not None and elapsed_s > self.max_left_s + END_TOLERANCE_S:
            return None
        return SignalPhase(
            self.state,
            _less(self.min_left_s, elapsed_s),
            _less(self.max_left_s, elapsed_s),
            _less(self.likely_left_s, elapsed_s),
        )


def _less(left_s: float | None, elapsed_s: float) -> float | None:
    return None if left_s is None else max(left_s - elapsed_s, 0.0)


def message_age_s(state: IntersectionState, minute_s: float | None, utc_s: float) -> float | None:
    """Return how old the message is by its own time; `None` if it states no whole time.

    Args:
        state: the intersection's part of it.
        minute_s: minute of the whole message, since the beginning of the year; used where the
            intersection states none.
        utc_s: now, in seconds since 1970.
    """
    moy_s = minute_s if state.moy_s is None else state.moy_s
    if moy_s is None or state.time_stamp_s is None:
        return None
    in_year_s = moy_s + state.time_stamp_s
    year = datetime.fromtimestamp(utc_s, UTC).year
    ages_s = (
        utc_s - datetime(each, 1, 1, tzinfo=UTC).timestamp() - in_year_s
        for each in (year - 1, year, year + 1)
    )
    return min(ages_s, key=abs)


def signal_phases(state: IntersectionState, sent_utc_s: float) -> Mapping[int, SignalPhase]:
    """Return the present phase of each signal group that shows something.

    Args:
        state: the intersection's part of a SPAT message.
        sent_utc_s: time of the message on the sender's clock, in seconds since 1970.

    Raises:
        DecodeError: `dark`, `ends_in_past` or `contradictory`.
    """
    if state.status & DARK:
        raise DecodeError("dark", ", ".join(_names(state.status & DARK)))
    phases: dict[int, SignalPhase] = {}
    for movement in state.states:
        if movement.signal_group in {UNKNOWN_SIGNAL_GROUP, PERMANENTLY_GREEN}:
            continue
        phase = _phase(movement, sent_utc_s % HOUR_S)
        if phases.setdefault(movement.signal_group, phase) != phase:
            raise DecodeError("contradictory", f"two phases of group {movement.signal_group}")
    unlit = (MovementPhaseState.UNAVAILABLE, MovementPhaseState.DARK)
    return {group: phase for group, phase in phases.items() if phase.state not in unlit}


def _names(status: IntersectionStatus) -> list[str]:
    return [str(flag.name).lower() for flag in status]


def _phase(movement: MovementState, in_hour_s: float) -> SignalPhase:
    event, group = movement.events[0], movement.signal_group
    timing = event.timing or TimeChangeDetails(None, None)
    earliest_s, latest_s, likely_s = (
        _left_s(mark_s, in_hour_s, group)
        for mark_s in (timing.min_end_s, timing.max_end_s, timing.likely_s)
    )
    in_order = [each for each in (earliest_s, likely_s, latest_s) if each is not None]
    if in_order != sorted(in_order):
        raise DecodeError(
            "contradictory",
            f"group {group} ends in {earliest_s} to {latest_s} s, likely {likely_s}",
        )
    return SignalPhase(event.event_state, earliest_s, latest_s, likely_s)


def _left_s(mark_s: float | None, in_hour_s: float, group: int) -> float | None:
    """Return the time to a TimeMark of this or the next hour; `None` for an unknown one."""
    if mark_s is None or mark_s >= HOUR_S:
        return None
    left_s = (mark_s - in_hour_s) % HOUR_S
    ended_s = HOUR_S - left_s
    if ended_s > MAX_ENDED_S:
        return left_s
    if ended_s > END_TOLERANCE_S:
        raise DecodeError("ends_in_past", f"group {group} ended {ended_s:.1f} s before the message")
    return 0.0
