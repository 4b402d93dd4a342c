"""A warning group of three signing vehicles whose leader truly brakes, for insiders to disturb.

They follow one another on an open road, and receive each other and the insiders without loss.
What counts is what the drivers are told: alarms, and not the warnings that raise them.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from onboard.lcca.events import Identified, WarningOver, WarningRaised
from onboard.messages import lcca
from onboard.messages.lcca import CarId, LccaMessage, Warn
from onboard.misbehaviour.signer_credibility import SignerIgnored
from onboard.observations import (
    HardBrake,
    Lead,
    LeadIdentity,
    PlateCandidate,
    Position,
    Sensor,
    Speed,
)
from onboard.risk.alarm import Alarm, Level
from onboard.risk.lcca_warning import LCCA
from onboard.security import ieee1609dot2
from onboard.security.credentials import Credentials
from onboard.security.plate_digest import PlateDigest
from onboard.security.settings import PlateDigestSettings
from onboard.settings import parse_settings
from onboard.step import Input, ReceivedWsm
from onboard.trace.trace_line import Event
from onboard.vehicle.config import CarConfig
from onboard.vehicle.framing import bsm_sender
from onboard.vehicle.stack import Stack
from onboard.wave_udp import psid, wsmp
from sim_rig.studies.attacks.attack_world import SPEED_M_S, STEP_S, Sender, placed, refused

DIGEST = {"scrypt_log2_n": 1}
Listener = Callable[[LccaMessage, bytes, float], Iterable[bytes]]
"""Takes a message, the 1609.2 data that it came in, and the time; returns WSMs."""
LEADER, *FOLLOWERS = PLATES = ("AAA1", "BBB2", "CCC3")
SENSORS = (Sensor.SPEED, Sensor.POSITION, Sensor.CAMERA)
READ, BADLY_READ, NOT_READ = 0.98, 0.6, 0.0
"""Probabilities of the text that cameras read on the plate ahead."""
GAP_M = 15.0
BRAKE_M_S2 = 6.0
BRAKING_S = 1.0
DETECTED_S = 0.3
"""From the start of a braking, and from its end, until the leader detects it."""


@dataclass(slots=True)
class Warned:
    """An alarm of one follower, or a warning on which an alarm may rest."""

    plate: str
    origin_id: CarId
    """Of the vehicle that brakes; empty where an alarm has another cause."""
    began_at: float
    ended_at: float = math.inf


class AttackedGroup:
    """The vehicles of `PLATES`, the first one in front."""

    def __init__(
        self,
        keys: Mapping[str, Credentials],
        utc_s: float,
        rngs: Sequence[np.random.Generator],
        *,
        checks: bool = True,
        reach: int = len(PLATES),
        plate: float = READ,
        ahead: str | None = None,
    ) -> None:
        """Start at time 0, which is `utc_s`.

        Args:
            keys: credentials by plate.
            utc_s: seconds since 1970.
            rngs: one for each vehicle.
            checks: whether brakings and claims are checked.
            reach: vehicles ahead and behind that each receives.
            plate: probability of the text that cameras read on the plate ahead; 0: of none.
            ahead: plate of a vehicle ahead of the first one, which is no vehicle of the group.
        """
        self.now = 0.0
        self.leader_ids: list[CarId] = []
        """Communication IDs of the leader, the present one last."""
        self.newest = 0
        """Event sequence number that the leader has sent last."""
        self.events: list[tuple[str, Event]] = []
        """Of the followers, with their plates."""
        self.listeners: list[Listener] = []
        """Insiders who answer what they receive, before others do."""
        self.temporary_id = bytes(4)
        """Of the leader's BSMs."""
        self.sent = 0
        """Frames of the insiders."""
        self.way_m = 0.0
        """Of the leader."""
        self.speed_m_s = SPEED_M_S
        """Of all."""
        self._reach, self._plate, self._ahead = reach, plate, ahead
        self._utc_s = utc_s
        self._digest = PlateDigest(PlateDigestSettings.model_validate(DIGEST))
        self._inputs: dict[str, list[Input]] = {plate: [] for plate in PLATES}
        self._stacks = {}
        for name, rng in zip(PLATES, rngs, strict=True):
            tree = {
                "car": {"plate": name},
                "gnss": {},
                "security": {"plate_digest": DIGEST, "check_braking": checks},
            }
            config = parse_settings(tree, CarConfig, name)
            self._stacks[name] = Stack(
                config, SENSORS, rng, now=0.0, utc_s=utc_s, credentials=keys[name]
            )

    def drive(
        self, duration_s: float, senders: Iterable[Sender] = (), braking_at: float = math.inf
    ) -> None:
        """Drive, and receive what `senders` send ten times a second.

        Args:
            duration_s: for so long.
            senders: the insiders.
            braking_at: when all begin to brake, which only the leader warns of. They go on as
                slowly for a second, and then regain their speed.
        """
        senders = list(senders)
        for _ in range(round(duration_s / STEP_S)):
            since_s = self.now - braking_at
            lost_m_s = BRAKE_M_S2 * min(max(since_s, 0.0), BRAKING_S)
            regained_m_s = 2.0 * max(since_s - 2.0 * BRAKING_S, 0.0)
            self._observe(SPEED_M_S - max(lost_m_s - regained_m_s, 0.0))
            for after_s, level_m_s2 in ((DETECTED_S, BRAKE_M_S2), (DETECTED_S + BRAKING_S, 0.0)):
                if abs(since_s - after_s) < STEP_S / 2.0:
                    brake = HardBrake(self.now, level_m_s2, "obd", is_over=level_m_s2 == 0.0)
                    self._inputs[LEADER].append(brake)
            for wsm in (wsm for send in senders for wsm in send(self.now)):
                self._inject(wsm)
            self._run(self.now + STEP_S)

    def warned(self, plate: str) -> list[Warned]:
        """Return the warnings of a follower."""
        warned: dict[tuple[CarId, int], Warned] = {}
        ended: list[Warned] = []
        for event in self._events_of(plate):
            match event:
                case WarningRaised():
                    warned[event.origin_id, event.sequence] = Warned(
                        plate, event.origin_id, event.stamp_s
                    )
                case WarningOver() if (event.origin_id, event.sequence) in warned:
                    over = warned.pop((event.origin_id, event.sequence))
                    over.ended_at = event.stamp_s
                    ended.append(over)
        return ended + list(warned.values())

    def alarms(self, plate: str) -> list[Warned]:
        """Return the alarms of a follower, each once however its level changed."""
        active: dict[tuple[str, str], Warned] = {}
        ended: list[Warned] = []
        for event in self._events_of(plate):
            if not isinstance(event, Alarm):
                continue
            key = event.cause, event.vehicle
            if event.level is Level.NONE and key in active:
                active[key].ended_at = event.stamp_s
                ended.append(active.pop(key))
            elif event.level is not Level.NONE and key not in active:
                origin = event.reasons[0].name if event.cause == LCCA else ""
                active[key] = Warned(plate, bytes.fromhex(origin), event.stamp_s)
        return ended + list(active.values())

    def received(self) -> int:
        """Return how many frames of the insiders the follower received that refused most."""
        return self.sent - max(refused(self._events_of(plate)) for plate in FOLLOWERS)

    def ignored(self) -> set[bytes]:
        """Return the signers that a follower ignores."""
        return {each.signer_id for _, each in self.events if isinstance(each, SignerIgnored)}

    def leads(self, plate: str) -> list[tuple[float, bool]]:
        """Return when a follower identified a vehicle, and whether it is the one ahead."""
        ahead = PLATES[PLATES.index(plate) - 1]
        return [
            (each.stamp_s, each.car_id == self._digest.car_id(ahead, self._utc_s + each.stamp_s))
            for each in self._events_of(plate)
            if isinstance(each, Identified)
        ]

    def _events_of(self, plate: str) -> Iterator[Event]:
        return (event for name, event in self.events if name == plate)

    def _observe(self, speed_m_s: float) -> None:
        """Give every vehicle its speed, place and lead vehicle."""
        self.speed_m_s = speed_m_s
        self.way_m += STEP_S * speed_m_s
        for number, plate in enumerate(PLATES):
            place = placed(0.0, self.way_m - GAP_M * number)
            fix = Position(self.now, *place, None, 0.5, speed_m_s, 0.0)
            self._inputs[plate] += [fix, Speed(self.now, speed_m_s, 0.1, "dbc"), self._lead(number)]

    def _lead(self, number: int) -> Lead:
        text = PLATES[number - 1] if number else self._ahead
        if text is None:
            return Lead(self.now, LeadIdentity.NO_LEAD)
        if not self._plate:
            return Lead(
                self.now, LeadIdentity.UNKNOWN, None, GAP_M, 0.3, 0.0, 0.3, track_id=1 + number
            )
        return Lead(
            self.now,
            LeadIdentity.KNOWN,
            text,
            GAP_M,
            0.3,
            0.0,
            0.3,
            track_id=1 + number,
            candidates=(PlateCandidate(text, self._plate),),
        )

    def _run(self, until: float) -> None:
        self._settle()
        while (at := min(stack.get_timer() for stack in self._stacks.values())) < until:
            self.now = max(at, self.now + 1e-4)
            self._settle()
        self.now = until

    def _settle(self) -> None:
        """Step the vehicles until no frame is on its way."""
        while True:
            all_inputs, self._inputs = self._inputs, {plate: [] for plate in PLATES}
            for plate, stack in self._stacks.items():
                outputs = stack.step(all_inputs[plate], self.now)
                for wsm in outputs.wsms:
                    self._broadcast(wsm.data, plate)
                    for answer in self._answers(wsm.data):
                        self._inject(answer)
                if plate == LEADER:
                    self._overhear(wsm.data for wsm in outputs.wsms)
                else:
                    self.events += [(plate, event) for event in outputs.events]
            if not any(self._inputs.values()):
                return

    def _answers(self, wsm: bytes) -> Iterator[bytes]:
        """Yield what insiders make of a message of the group."""
        frame = wsmp.decode(wsm)
        if frame.psid == psid.LCCA and self.listeners:
            secured = frame.payload
            message = lcca.decode(ieee1609dot2.decode(secured).payload).message
            for listener in self.listeners:
                yield from listener(message, secured, self.now)

    def _inject(self, wsm: bytes) -> None:
        """Let all receive what an insider sends."""
        self.sent += 1
        self._broadcast(wsm)

    def _broadcast(self, wsm: bytes, sender: str | None = None) -> None:
        for number, plate in enumerate(PLATES):
            apart = 0 if sender is None else abs(number - PLATES.index(sender))
            if plate != sender and apart <= self._reach:
                self._inputs[plate].append(ReceivedWsm(self.now, wsm))

    def _overhear(self, wsms: Iterable[bytes]) -> None:
        """Take the leader's ID and event sequence number, as anybody in radio range can."""
        for frame in map(wsmp.decode, wsms):
            if frame.psid == psid.BSM:
                self.temporary_id = bsm_sender(frame) or self.temporary_id
            if frame.psid != psid.LCCA:
                continue
            message = lcca.decode(ieee1609dot2.decode(frame.payload).payload).message
            if message.sender_id not in self.leader_ids[-1:]:
                self.leader_ids.append(message.sender_id)
            if isinstance(message, Warn):
                self.newest = message.event_sequence
