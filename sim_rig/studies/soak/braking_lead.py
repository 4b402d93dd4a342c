"""A lead vehicle that brakes hard again and again, 12 m ahead of a host at constant speed."""

import math

PERIOD_S = 1.1
"""Interval of the brakings."""
HOST_M_S = 48.0 / 3.6
"""Whole km/h, as OBD-II says it."""
GAP_M = 12.0
"""While the lead vehicle cruises."""
LENGTH_M = 4.5

_DROP_M_S, _HALF_S = 4.0, 0.5
_FASTEST_M_S = HOST_M_S + _DROP_M_S * _HALF_S / PERIOD_S
"""So that the mean is the host's speed."""
_CRUISE_S = 2.0 * _HALF_S - _HALF_S * _HALF_S / PERIOD_S
"""Time into a period at which the lead vehicle, accelerating, is as fast as the host."""


class BrakingLead:
    """Speeds and places of both vehicles; one source for all sensors that see them."""

    def __init__(self, began_at: float) -> None:
        """Start at place 0, without braking until `brakes_from_at` is set."""
        self._began_at = began_at
        self.brakes_from_at = math.inf

    def host_m(self, now: float) -> float:
        """Place of the host's middle."""
        return HOST_M_S * (now - self._began_at)

    def gap_m(self, now: float) -> float:
        """Distance from the host's front to the lead vehicle's rear."""
        return GAP_M + _gained_m(self._into_s(now)) - _gained_m(_CRUISE_S)

    def lead_m(self, now: float) -> float:
        """Place of the lead vehicle's middle."""
        return self.host_m(now) + self.gap_m(now) + LENGTH_M

    def lead_m_s(self, now: float) -> float:
        """Speed of the lead vehicle: half a second of braking, half a second of acceleration."""
        return _FASTEST_M_S - _DROP_M_S * max(0.0, 1.0 - abs(self._into_s(now) - _HALF_S) / _HALF_S)

    def _into_s(self, now: float) -> float:
        """Time into the period of a braking; while cruising, a time at which it is not felt."""
        return (_CRUISE_S + max(0.0, now - self.brakes_from_at)) % PERIOD_S


def _gained_m(into_s: float) -> float:
    """Distance that the lead vehicle has gained on the host since the period began."""
    braked_s = into_s * into_s if into_s <= _HALF_S else 0.5 - (max(0.0, 1.0 - into_s)) ** 2
    return (_FASTEST_M_S - HOST_M_S) * into_s - _DROP_M_S * braked_s


LEAST_GAP_M, LARGEST_GAP_M = (
    GAP_M + _gained_m(into_s) - _gained_m(_CRUISE_S) for into_s in (_CRUISE_S, 1.0 - _CRUISE_S)
)
