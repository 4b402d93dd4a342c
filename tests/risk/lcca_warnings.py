"""Warnings of a group, as its core gives them to the risk monitor."""

from onboard.lcca.events import WarningRaised
from onboard.messages.lcca import CarId
from onboard.observations import BrakeCause


def lcca_warning(stamp_s: float, origin_id: CarId, sequence: int = 7) -> WarningRaised:
    """A car two ahead brakes with 6 m/s2; the event is 0.02 s old."""
    return WarningRaised(
        stamp_s, origin_id, sequence, 1, 3, origin_id, BrakeCause.DECELERATION, 6.0, 0.02, 2
    )
