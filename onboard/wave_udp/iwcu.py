"""The wire to an IWCU-style radio unit: UDP, a datagram is the WSMP frame and nothing else.

LCCA, section 4: the unit turns UDP packets into WSMs and back. The user priority travels as the IP
precedence, the three high bits of the type of service octet (RFC 791, 3.1).
"""

import asyncio
import socket
import struct
from collections.abc import Callable

from onboard.wave_udp.drained_socket import DrainedSocket, udp_socket
from onboard.wave_udp.settings import IwcuSettings

_TOS = [
    [(socket.IPPROTO_IP, socket.IP_TOS, struct.pack("i", priority << 5))] for priority in range(8)
]


class IwcuEndpoint:
    """Sends WSMs to the unit, and hands over those that come from it."""

    def __init__(
        self,
        settings: IwcuSettings,
        on_wsm: Callable[[bytes], None],
        on_trouble: Callable[[str], None],
    ) -> None:
        """Bind the port. Raises `RadioError`."""
        self._unit = str(settings.unit_host), settings.unit_port
        wire = udp_socket(str(settings.listen_host), settings.listen_port)
        self._socket = DrainedSocket(wire, on_wsm, on_trouble)

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Receive on `loop` from now on."""
        self._socket.start(loop)

    def send(self, wsm: bytes, user_priority: int) -> None:
        """Give `wsm` to the unit; it is lost where the unit is not there, as it is on the air."""
        self._socket.send(wsm, self._unit, _TOS[user_priority])

    def close(self) -> None:
        """Leave the wire."""
        self._socket.close()
