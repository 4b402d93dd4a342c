"""An insider attacker, who sends false messages with the radio and the keys of a car.

Forged messages are as plausible as an insider can make them: signed, in the right group, with
possible motion.
"""

import heapq
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count

from onboard.errors import DecodeError
from onboard.messages import bsm, lcca
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import VehicleEventFlags, VehicleSafetyExtensions
from onboard.messages.lcca import Reply, Update, Warn, WarnCause
from onboard.security import ieee1609dot2
from onboard.security.credentials import Credentials
from onboard.security.ieee1609dot2 import SignedData
from onboard.security.security_services import SecurityServices
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage
from sim_rig.scenario.faults import Attack

GHOST_ID = bytes.fromhex("6057CA12")
_GHOST_EVERY_S = 0.1
_GHOST_BRAKES_M_S2 = 6.0
_FORGED_M_S2 = 8.0
_FIRST_SEQUENCE = 40_000
_METRES_PER_DEGREE = 111_320.0


class Attacker:
    """One fault of kind `Attack`, without I/O."""

    def __init__(
        self,
        fault: Attack,
        at_s: Callable[[float], float],
        utc_offset_s: float,
        credentials: Credentials | None,
    ) -> None:
        """Prepare an attack.

        Args:
            fault: the attack.
            at_s: time since the start of the scenario at a `now`, s.
            utc_offset_s: UTC minus `now`, s.
            credentials: keys of the car; without them, messages are unsigned.
        """
        self.car = fault.car
        self._fault = fault
        self._at_s = at_s
        self._security = SecurityServices(utc_offset_s, credentials)
        own = () if credentials is None else credentials.pseudonyms
        self._credentials = {each.certificate.hashed_id8: each for each in own}
        self._signer: bytes | None = None
        self._core: CoreData | None = None
        self._group_message: Reply | Update | None = None
        self._proof: tuple[bytes, ...] = ()
        self._to_replay: list[tuple[float, int, int, bytes]] = []
        self._order = count()
        self._next_at = math.inf
        self._sequence = _FIRST_SEQUENCE
        self._ghost_began_at: float | None = None

    def overhear(self, sender: str, wsm: bytes, user_priority: int, now: float) -> None:
        """Process a frame of any car, also of the attacker's own.

        Args:
            sender: name of the sending car.
            wsm: the frame.
            user_priority: its user priority.
            now: monotonic time, s.
        """
        if not self._fault.holds(self.car, self._at_s(now)):
            return
        if self._fault.what == "replay":
            due_at = now + self._fault.delay_s
            heapq.heappush(self._to_replay, (due_at, next(self._order), user_priority, wsm))
        elif sender == self.car:
            self._learn(wsm)
            if self._next_at == math.inf:
                self._next_at = now

    def get_timer(self) -> float:
        """Return when the next frame is injected; `math.inf` when none is planned."""
        return self._to_replay[0][0] if self._to_replay else self._next_at

    def wsms_to_send(self, now: float) -> Iterator[tuple[int, bytes]]:
        """Yield the false messages that are due, as (user priority, WSM)."""
        while self._to_replay and self._to_replay[0][0] <= now:
            _, _, user_priority, wsm = heapq.heappop(self._to_replay)
            yield user_priority, wsm
        if self._next_at > now:
            return
        if not self._fault.holds(self.car, self._at_s(now)):
            self._next_at = math.inf
        elif self._fault.what == "forged_brake":
            self._next_at += self._fault.every_s
            if self._group_message is not None:
                yield Warn.user_priority, self._forged_warning(self._group_message, now)
        else:
            self._next_at += _GHOST_EVERY_S
            if self._core is not None:
                ghost = self._ghost(self._core, now)
                yield ghost.user_priority, self._sealed(bsm.encode(ghost), psid.BSM, now)

    def _learn(self, wsm: bytes) -> None:
        """Take position, group position and pseudonym of the car from its own messages."""
        frame = wsmp.decode(wsm)
        data = ieee1609dot2.decode(frame.payload)
        if isinstance(data, SignedData):
            self._sign_as(data)
        payload = data.payload
        if frame.psid == psid.BSM:
            self._core = bsm.decode(payload).core
            return
        try:
            pdu = lcca.decode(payload)
        except DecodeError:
            return
        if isinstance(pdu.message, Reply | Update):
            self._group_message, self._proof = pdu.message, pdu.proof

    def _sign_as(self, data: SignedData) -> None:
        """Sign with the car's current pseudonym: two pseudonyms with one ID are implausible."""
        signer = data.signer if isinstance(data.signer, bytes) else data.signer[0].hashed_id8
        if signer != self._signer:
            self._signer = signer
            self._security.sign_with(self._credentials[signer])

    def _forged_warning(self, place: Reply | Update, now: float) -> bytes:
        self._sequence += 1
        warn = Warn(
            sender_id=place.sender_id,
            leader_id=place.leader_id,
            number=place.number,
            event_origin_id=place.sender_id,
            event_sequence=self._sequence,
            reach=0,
            origin_number=place.number,
            first_sequence=self._sequence,
            cause=WarnCause.DECELERATION,
            deceleration_m_s2=_FORGED_M_S2,
            age_s=0.05,
            hops=1,
        )
        return self._sealed(lcca.encode(warn, self._proof), psid.LCCA, now)

    def _ghost(self, core: CoreData, now: float) -> BasicSafetyMessage:
        """BSM of a car ahead in the lane that brakes for half a cycle and accelerates again."""
        if self._ghost_began_at is None:
            self._ghost_began_at = now
        since_s = now - self._ghost_began_at
        half_s = self._fault.every_s / 2.0
        phase_s = since_s % self._fault.every_s
        lost_m_s = _GHOST_BRAKES_M_S2 * (half_s - abs(phase_s - half_s))
        flags = VehicleEventFlags.HARD_BRAKING if phase_s < half_s else None
        ghost = replace(
            _ahead(core, self._fault.ahead_m),
            temporary_id=GHOST_ID,
            msg_cnt=round(since_s / _GHOST_EVERY_S) % 128,
            speed_m_s=max(0.0, (core.speed_m_s or 0.0) - lost_m_s),
        )
        safety = VehicleSafetyExtensions(events=flags) if flags else None
        return BasicSafetyMessage(ghost, safety)

    def _sealed(self, payload: bytes, service: int, now: float) -> bytes:
        secured = self._security.secure(payload, service, now)
        return wsmp.encode(WaveShortMessage(psid=service, payload=secured))


def _ahead(core: CoreData, ahead_m: float) -> CoreData:
    """Move a position ahead along its heading; without position or heading it stays."""
    if core.latitude_deg is None or core.longitude_deg is None or core.heading_rad is None:
        return core
    north_deg = ahead_m * math.cos(core.heading_rad) / _METRES_PER_DEGREE
    east_deg = ahead_m * math.sin(core.heading_rad) / _METRES_PER_DEGREE
    east_deg /= math.cos(math.radians(core.latitude_deg))
    return replace(
        core,
        latitude_deg=core.latitude_deg + north_deg,
        longitude_deg=core.longitude_deg + east_deg,
    )
