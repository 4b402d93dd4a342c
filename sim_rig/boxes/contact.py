"""What a box does on each wire, as seen from the rig's ends: is it ready, and what does it know."""

import contextlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

from onboard.errors import DecodeError, UserError
from onboard.messages import bsm
from onboard.messages.bsm_core import CoreData
from onboard.security import ieee1609dot2
from onboard.security.oer import Malformed, Unsupported
from onboard.tools.doctor.finding import Finding, FindingLevel
from onboard.wave_udp import psid, wsmp
from sim_rig.boxes.settings import BoxSettings
from sim_rig.scenario.schema import Scenario

_NO_WSM = -1
_NAMES = {psid.BSM: "BSM", psid.LCCA: "LCCA", _NO_WSM: "no WSM"}


class BoxNotReadyError(UserError):
    """A box did not use all of its wires in time."""


@dataclass
class Contact:
    """Counts what one box has used."""

    answers: int = 0
    """Requests of the box that the ECU has answered."""
    pictures: int = 0
    """Images that the box has taken from the camera."""
    frames: Counter[int] = field(default_factory=Counter)
    """Its frames by PSID; `_NO_WSM` for what is none."""
    core: CoreData | None = None
    """Part I of its last BSM."""

    def receive_wsm(self, wsm: bytes) -> None:
        """Process a frame of the box."""
        try:
            message = wsmp.decode(wsm)
        except DecodeError:
            self.frames[_NO_WSM] += 1
            return
        self.frames[message.psid] += 1
        if message.psid == psid.BSM:
            with contextlib.suppress(DecodeError, Malformed, Unsupported):
                self.core = bsm.decode(ieee1609dot2.decode(message.payload).payload).core

    def findings(self, car: str, box: BoxSettings, scenario: Scenario) -> Iterator[Finding]:
        """Yield one for each wire that the scenario needs: whether the box uses it.

        Args:
            car: name of the box.
            box: its wires.
            scenario: what it shall drive.
        """
        yield self._bus(box)
        address = f"http://{box.camera.host}:{box.camera.port}/{car}"
        yield _finding(
            "camera",
            "it has taken no image" if not self.pictures else "",
            f"{self.pictures} images taken",
            f"camera.source of the box is {address}, and this computer can be reached there",
        )
        if not scenario.beacons:
            return
        yield _finding(
            "radio",
            f"no BSM of it has arrived{self._frames(': ')}" if self.core is None else "",
            self._frames(),
            f"the {box.radio.endpoint} of the box is {box.radio.host}, UDP port {box.radio.port}",
        )
        if scenario.gnss is not None:
            yield _finding(
                "satellites",
                "" if self.core and self.core.latitude_deg is not None else "no BSM has a position",
                "its BSMs have a position",
                "gpsd of the box reads the wire `satellites`, and `gnss` of the box that gpsd",
            )

    def missing(self, car: str, box: BoxSettings, scenario: Scenario) -> list[Finding]:
        """Return the findings that a run waits for; for arguments, see `findings`.

        A box without a recording may be of another vendor, with a radio and nothing else.
        """
        return [
            each
            for each in self.findings(car, box, scenario)
            if each.level is FindingLevel.MISSING
            and (box.recording is not None or each.subject == "radio")
        ]

    def _bus(self, box: BoxSettings) -> Finding:
        has_speed = self.core is None or self.core.speed_m_s is not None
        missing = "its BSMs have no speed" if not has_speed else ""
        bus = box.bus
        places = {"socketcand": f"{bus.host}:{bus.port}, ", "slcan": "of slcand, "}
        kind = "socketcand" if bus.interface == "socketcand" else "socketcan"
        return _finding(
            "bus",
            missing if self.answers else "it has requested no speed",
            f"{self.answers} speeds sent",
            f"`can` of the box is {kind} ({places.get(bus.interface, '')}{bus.channel})",
        )

    def _frames(self, before: str = "") -> str:
        """Frames by service; empty if there are none."""
        counted = [f"{n} {_NAMES.get(each, hex(each))}" for each, n in sorted(self.frames.items())]
        return before + ", ".join(counted) if counted else ""


def _finding(subject: str, missing: str, good: str, advice: str) -> Finding:
    """Return a finding: `missing` says what is, and is empty if nothing is."""
    if missing:
        return Finding(subject, FindingLevel.MISSING, missing, advice)
    return Finding(subject, FindingLevel.GOOD, good)
