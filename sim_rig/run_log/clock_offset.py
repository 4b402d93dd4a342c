"""Offset of a box's clock, from frames that both ends have stamped.

No frame arrives before it is sent. So each frame from the box is an upper bound of the offset, and
each frame to it a lower one; the truth lies between the least and the greatest of them, however
unequal the delays of the two ways are (Cristian 1989, without its assumption of symmetry).
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from onboard.errors import UserError

MAX_RATE_ERROR = 1e-4
"""Largest relative rate of two clocks: two crystals of 50 ppm."""


class ClockError(UserError):
    """The offset cannot be measured; the text is the reason."""


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """Rig time minus box time, at any time of the run."""

    offset_s: float
    uncertainty_s: float
    """The offset is within this of `offset_s`, also at both ends of the run."""
    frames_from_box: int
    frames_to_box: int


def clock_offset(
    from_box: Iterable[tuple[float, float]], to_box: Iterable[tuple[float, float]]
) -> ClockOffset:
    """Bound the offset of a box's clock.

    Args:
        from_box: for each frame of the box, when it was sent (box time) and received (rig time).
        to_box: for each frame to the box, when it was sent (rig time) and received (box time).

    Raises:
        ClockError: a direction has no frames, or the bounds contradict each other.
    """
    sent, received = list(from_box), list(to_box)
    if not sent or not received:
        silent = "from" if not sent else "to"
        raise ClockError(f"no frame {silent} the box is in both records")
    rig_times = [rig for _, rig in sent] + [rig for rig, _ in received]
    middle_s, half_s = (max(rig_times) + min(rig_times)) / 2, (max(rig_times) - min(rig_times)) / 2

    def drift_s(rig_s: float) -> float:
        return MAX_RATE_ERROR * abs(rig_s - middle_s)

    upper_s = min((rig - box + drift_s(rig) for box, rig in sent), default=math.inf)
    lower_s = max((rig - box - drift_s(rig) for rig, box in received), default=-math.inf)
    if upper_s < lower_s:
        raise ClockError(f"it jumped in the run, by {lower_s - upper_s:.3f} s or more")
    return ClockOffset(
        (upper_s + lower_s) / 2,
        (upper_s - lower_s) / 2 + MAX_RATE_ERROR * half_s,
        len(sent),
        len(received),
    )
