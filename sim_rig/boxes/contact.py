"""What a box does on each wire, as seen from the rig's ends: is it ready, and what does it know."""

import contextlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

from onboard import psid
from onboard.errors import DecodeError
from onboard.messages import bsm
from onboard.messages.bsm_core import CoreData
from onboard.security import ieee1609dot2
from onboard.security.oer import Malformed, Unsupported
from onboard.wave_udp import wsmp
from sim_rig.scenario.schema import Scenario


@dataclass
class Contact:
    """Counts what one box has used."""

    answers: int = 0
    """Requests of the box that the ECU has answered."""
    pictures: int = 0
    """Images that the box has taken from the camera."""
    frames: Counter[int] = field(default_factory=Counter)
    """Its frames by PSID; -1 for what is no WSM."""
    core: CoreData | None = None
    """Part I of its last BSM."""

    def receive_wsm(self, wsm: bytes) -> None:
        """Process a frame of the box."""
        try:
            message = wsmp.decode(wsm)
        except DecodeError:
            self.frames[-1] += 1
            return
        self.frames[message.psid] += 1
        if message.psid == psid.BSM:
            with contextlib.suppress(DecodeError, Malformed, Unsupported):
                self.core = bsm.decode(ieee1609dot2.decode(message.payload).payload).core

    def missing(self, scenario: Scenario) -> Iterator[str]:
        """Yield what the box does not do yet, though a scenario needs it."""
        if not self.answers:
            yield "bus: it has requested no speed"
        if not self.pictures:
            yield "camera: it has taken no image"
        if not scenario.beacons:
            return
        if self.core is None:
            yield "radio: no BSM of it has arrived"
            return
        if self.core.speed_m_s is None:
            yield "bus: its BSMs have no speed"
        if scenario.gnss is not None and self.core.latitude_deg is None:
            yield "satellites: its BSMs have no position"
