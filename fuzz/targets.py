"""The decoders under fuzzing: a target takes any bytes, and raises nothing but what it declares."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from onboard.messages import bsm, lcca
from onboard.messages.declaration import DecodeError
from onboard.obd.can_frame import CanFrame
from onboard.obd.car_bus import CarBus
from onboard.obd.settings import ObdSettings
from onboard.obd.socketcand import ProtocolError, parse_element
from onboard.security import p256
from onboard.security.authority import make_trial
from onboard.security.security import NotTrusted, Security
from onboard.wave_udp import immediate_forward, wsmp
from onboard.wave_udp.capture import CaptureError, read_capture
from onboard.wave_udp.decode import describe

MOST_S_PER_KILOBYTE = 1e-3
"""What reading a kilobyte may take; shorter input may take as much as a kilobyte."""


@dataclass(frozen=True, slots=True)
class Target:
    """One decoder."""

    read: Callable[[bytes], object]
    declared: tuple[type[Exception], ...] = ()

    def feed(self, data: bytes) -> None:
        """Let the decoder read `data`; what it does not declare comes through."""
        with suppress(*self.declared):
            self.read(data)


def _wsmp(data: bytes) -> None:
    wsm = wsmp.decode(data)
    if wsm.version == wsmp.VERSION and wsmp.decode(wsmp.encode(wsm)) != wsm:
        raise AssertionError(f"{wsm} is not what its encoding says")


def _rsu41(data: bytes) -> None:
    message = immediate_forward.decode(data)
    if immediate_forward.decode(immediate_forward.encode(message)) != message:
        raise AssertionError(f"{message} is not what its encoding says")


def _bsm(data: bytes) -> None:
    message = bsm.decode(data)
    bsm.as_dict(message)
    if bsm.decode(bsm.encode(message)) != message:
        raise AssertionError(f"{message} is not what its encoding says")


def _lcca(data: bytes) -> None:
    message = lcca.decode(data)
    lcca.as_dict(message)
    if lcca.decode(lcca.encode(message)) != message:
        raise AssertionError(f"{message} is not what its encoding says")


_UTC_S = 1_790_000_000.0
_TRIAL = make_trial(
    ["receiver", "sender"], [bsm.PSID], _UTC_S, p256.key_from(np.random.default_rng(1609))
)
_SECURITY = Security(_UTC_S, _TRIAL["receiver"])
"""Trusts the sender, whose messages are in the corpus."""


def _security(data: bytes) -> object:
    return _SECURITY.open(data, bsm.PSID, now=0.0)


def _capture(data: bytes) -> None:
    for _ in read_capture(data):
        pass


def _can(data: bytes) -> None:
    """Frames on the bus: identifier and length in an octet, then so many of data; 0.1 s apart."""
    bus = CarBus(ObdSettings())
    position, now = 0, 0.0
    while position < len(data):
        size = data[position] & 0x0F
        ecu = 0x7E8 + (data[position] >> 4)
        content = data[position + 1 : position + 1 + size]
        bus.receive_frame(CanFrame(now, ecu, is_extended_id=False, data=content), now)
        bus.frames_to_send(now)
        while bus.next_event() is not None:
            pass
        position += 1 + size
        now += 0.1


def _socketcand(data: bytes) -> object:
    return parse_element(data.decode("latin-1"))


TARGETS = {
    "wsmp": Target(_wsmp, (DecodeError,)),
    "rsu41": Target(_rsu41, (DecodeError,)),
    "capture": Target(_capture, (CaptureError,)),
    "describe": Target(describe),
    "ieee1609dot2": Target(_security, (NotTrusted,)),
    "bsm": Target(_bsm, (DecodeError,)),
    "lcca": Target(_lcca, (DecodeError,)),
    "can": Target(_can),
    "socketcand": Target(_socketcand, (ProtocolError,)),
}
"""By the name of their corpus."""
