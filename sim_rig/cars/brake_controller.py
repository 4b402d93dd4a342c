"""The controller of a test vehicle that brakes as its daemon requests, without I/O."""

from collections.abc import Callable

from onboard.brake_request import datagram

BRAKE_DELAY_S = 0.3
"""From a request to the braking: the pressure has to build up."""


class BrakeController:
    """Turns the daemon's datagrams into braking."""

    def __init__(self, brake: Callable[[float, float, float], None]) -> None:
        """Take the brakes.

        Args:
            brake: takes begin and end of a braking in s, and its deceleration in m/s^2; each call
                replaces what an earlier one asks for from then on.
        """
        self._brake = brake

    def receive_bytes(self, data: bytes, at_s: float) -> None:
        """Obey one datagram.

        Raises:
            DecodeError: it is no request.
        """
        request = datagram.decode(data)
        begin_s = at_s + BRAKE_DELAY_S
        self._brake(begin_s, begin_s + request.valid_s, request.deceleration_m_s2)
