"""Radio units at the end of the cars' UDP connections.

As ITRI's unit in the LCCA paper (section 4): a datagram holds one WSM, and its IP precedence is the
user priority (IP_TOS = priority << 5). A unit of a box may receive Immediate Forward messages
instead. Each car's unit has a socket; all share one channel.
"""

import asyncio
import math
import socket
import time
from collections.abc import Callable
from functools import partial

from onboard.errors import DecodeError
from onboard.wave_udp import immediate_forward, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage
from sim_rig.radio.air import Air, Delivery
from sim_rig.run_log.rig_recorder import RigRecorder
from sim_rig.scenario.wire_settings import RadioWire

_LARGEST = 65_535
_TOS_ROOM = socket.CMSG_SPACE(1)


class RadioUnits:
    """All units of a run."""

    def __init__(
        self,
        air: Air,
        recorder: RigRecorder,
        is_mute: Callable[[str, float], bool] = lambda _car, _now: False,
        on_late: Callable[[float], None] = lambda _late_s: None,
    ) -> None:
        """Connect the units to a channel.

        Args:
            air: the channel.
            recorder: records transmitted and delivered frames.
            is_mute: whether the unit of a car does not transmit at a `now`.
            on_late: called with the lateness of each delivered frame, s.
        """
        self._air = air
        self._is_mute = is_mute
        self._on_late = on_late
        self._recorder = recorder
        self._sockets: list[socket.socket] = []
        self._hand_over: dict[str, Callable[[Delivery], None]] = {}
        self._timer: asyncio.TimerHandle | None = None

    def add(self, car: str, wire: RadioWire) -> None:
        """Open the unit of `car` at its end of `wire`."""
        unit = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        unit.bind((str(wire.host), wire.port))
        unit.setblocking(False)
        unit.setsockopt(socket.IPPROTO_IP, socket.IP_RECVTOS, 1)
        self._sockets.append(unit)
        self._hand_over[car] = partial(_send, unit, (str(wire.box_host), wire.box_port))
        read = wsm_reader(wire)
        asyncio.get_running_loop().add_reader(unit, self._receive, car, unit, read)

    def add_in_process(self, car: str, receive: Callable[[bytes], None]) -> None:
        """Let `receive` be called with each WSM for `car`, which needs no wire."""
        self._hand_over[car] = lambda delivery: receive(delivery.wsm)

    def transmit(self, car: str, wsm: bytes, user_priority: int) -> None:
        """Transmit a frame of a car without a wire; it is delivered in a later turn of the loop."""
        self._put_on_air(car, wsm, user_priority, time.monotonic())
        self._arm()

    def close(self) -> None:
        """Close all units."""
        if self._timer is not None:
            self._timer.cancel()
        for unit in self._sockets:
            asyncio.get_running_loop().remove_reader(unit)
            unit.close()

    def _receive(
        self, car: str, unit: socket.socket, read: Callable[[bytes, int], tuple[bytes, int]]
    ) -> None:
        while True:
            try:
                datagram, ancillary, _flags, _address = unit.recvmsg(_LARGEST, _TOS_ROOM)
            except BlockingIOError:
                break
            ip_precedence = next((data[0] >> 5 for _, _, data in ancillary), 0)
            self._put_on_air(car, *read(datagram, ip_precedence), time.monotonic())
        self._step()

    def _put_on_air(self, car: str, wsm: bytes, user_priority: int, now: float) -> None:
        if not self._is_mute(car, now):
            self._recorder.note_on_air(car, wsm, user_priority, now)
            self._air.receive_wsm(car, wsm, user_priority, now)

    def _step(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        now = time.monotonic()
        for delivery in self._air.wsms_to_deliver(now):
            self._recorder.note_delivery(
                delivery.receiver, delivery.sender, delivery.user_priority, delivery.wsm, now
            )
            self._on_late(now - delivery.at_s)
            self._hand_over[delivery.receiver](delivery)
        self._arm()

    def _arm(self) -> None:
        """Plan the next delivery; one that is due stays, or many transmissions would put it off."""
        at = self._air.get_timer()
        planned = self._timer
        if at < (math.inf if planned is None else planned.when()):
            if planned is not None:
                planned.cancel()
            self._timer = asyncio.get_running_loop().call_at(at, self._step)


def wsm_reader(wire: RadioWire) -> Callable[[bytes, int], tuple[bytes, int]]:
    """Return what reads a datagram to the unit of a wire, and its IP precedence.

    It returns the WSM and its user priority.
    """
    return _forwarded if wire.endpoint == "rsu41" else _as_received


def _as_received(datagram: bytes, ip_precedence: int) -> tuple[bytes, int]:
    return datagram, ip_precedence


def _forwarded(datagram: bytes, ip_precedence: int) -> tuple[bytes, int]:
    """Return the WSM and the user priority of an Immediate Forward message.

    What is none is transmitted as it is, so that it is counted.
    """
    try:
        message = immediate_forward.decode(datagram)
        wsm = wsmp.encode(WaveShortMessage(psid=message.psid, payload=message.payload))
    except (DecodeError, ValueError):
        return datagram, ip_precedence
    return wsm, message.priority


def _send(unit: socket.socket, address: tuple[str, int], delivery: Delivery) -> None:
    try:
        unit.setsockopt(socket.IPPROTO_IP, socket.IP_TOS, delivery.user_priority << 5)
        unit.sendto(delivery.wsm, address)
    except OSError:
        pass  # the car does not listen, or its address is gone: a frame is lost
