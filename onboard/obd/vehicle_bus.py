"""The car's bus as one core: asks for the speed, reads what the car sends, notices hard braking.

Addresses of ISO 15765-4: a functional request goes to every ECU; each ECU answers with its own
identifier, and is told to go on with a long answer under another one.

              functional   ECU answers                to one ECU
    11 bits   0x7DF        0x7E8 ... 0x7EF            answer's - 8
    29 bits   0x18DB33F1   0x18DAF1xx                 0x18DAxxF1
"""

import math
from collections import deque
from typing import TYPE_CHECKING

from typing_extensions import override

from onboard.core import Core
from onboard.obd import n_pdu, service_01
from onboard.obd.can_frame import CanFrame
from onboard.obd.hard_brake import HardBrakeDetector
from onboard.obd.iso_tp import Aborted, Reassembly
from onboard.obd.request_scheduler import RequestScheduler
from onboard.obd.settings import ObdSettings
from onboard.observations import BrakePedal, Discarded, HardBrake, Speed

if TYPE_CHECKING:
    from onboard.obd.broadcast import BroadcastSignals

FUNCTIONAL_11_BIT = 0x7DF
FUNCTIONAL_29_BIT = 0x18DB33F1

ECU_FRESH_S = 1.0
"""Of several ECUs that tell a speed, the one with the lowest identifier is believed (the engine's,
in practice) until it has been silent for this long."""

BROADCAST_FRESH_S = 0.5
"""A broadcast speed silences OBD for this long: mixing two scales would look like braking."""

_GO_ON = n_pdu.FlowControl(n_pdu.FlowStatus.CONTINUE_TO_SEND, block_size=0, st_min=0)
"""What a tester has to answer (ISO 15765-4)."""

_IDENTIFIERS = {"auto": (False, True), "11-bit": (False,), "29-bit": (True,)}

BusEvent = Speed | BrakePedal | HardBrake | Discarded


class VehicleBus(Core):
    """See the module's head. Holds nothing that grows: at most one reassembly for each ECU."""

    def __init__(self, settings: ObdSettings, signals: "BroadcastSignals | None" = None) -> None:
        """Start with nothing received.

        Args:
            settings: what to request.
            signals: those that the vehicle broadcasts; `None` if none are known.
        """
        self._tester = (
            RequestScheduler(settings.polling_hz, _IDENTIFIERS[settings.addressing])
            if settings.polling_hz is not None
            else None
        )
        self._signals = signals
        self._detector = HardBrakeDetector(settings.hard_brake_threshold_g)
        self._reassemblies: dict[tuple[int, bool], Reassembly] = {}
        self._speed_heard_at: dict[tuple[int, bool], float] = {}
        self._broadcast_heard_at: float | None = None
        self._to_send: deque[CanFrame] = deque()
        self._events: deque[BusEvent] = deque()

    def receive_frame(self, frame: CanFrame, now: float) -> None:
        """Take any frame of the bus; those that are neither OBD answers nor named are passed by."""
        if self._signals is not None:
            for observation in self._signals.receive_frame(frame):
                self._receive_broadcast(observation, now)
        if is_ecu_answer(frame.arbitration_id, is_extended_id=frame.is_extended_id):
            self._receive_from_ecu(frame, now)

    def frames_to_send(self, now: float) -> list[CanFrame]:
        """Requests and flow control that are due."""
        for request in self._tester.requests_to_send(now) if self._tester else ():
            self._send(
                FUNCTIONAL_29_BIT if request.is_extended_id else FUNCTIONAL_11_BIT,
                n_pdu.SingleFrame(service_01.request(request.pid)),
                now,
                is_extended_id=request.is_extended_id,
            )
        frames = list(self._to_send)
        self._to_send.clear()
        return frames

    @override
    def get_timer(self) -> float:
        """Return when the next request, or the next frame of a long answer, is due."""
        timers = [reassembly.get_timer() for reassembly in self._reassemblies.values()]
        if self._tester is not None:
            timers.append(self._tester.get_timer())
        return min(timers, default=math.inf)

    @override
    def handle_timer(self, now: float) -> None:
        """Give up answers that stopped half-way. Requests are due in `frames_to_send`."""
        for (ecu, is_extended_id), reassembly in self._reassemblies.items():
            reassembly.handle_timer(now)
            self._take_messages(reassembly, ecu, now, now, is_extended_id=is_extended_id)

    @override
    def next_event(self) -> BusEvent | None:
        """The oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def _receive_broadcast(self, observation: Speed | BrakePedal | Discarded, now: float) -> None:
        if isinstance(observation, Speed):
            self._broadcast_heard_at = observation.stamp_s
            if self._tester is not None:
                self._tester.rest_until(now + BROADCAST_FRESH_S)
            self._tell_speed(observation)
            return
        if isinstance(observation, BrakePedal):
            self._detector.receive_pedal(observation)
        self._events.append(observation)

    def _receive_from_ecu(self, frame: CanFrame, now: float) -> None:
        ecu, is_extended_id = frame.arbitration_id, frame.is_extended_id
        try:
            pdu = n_pdu.decode(frame.data)
        except n_pdu.NPduError as error:
            self._discard(frame.stamp_s, ecu, error.reason, str(error))
            return
        if isinstance(pdu, n_pdu.FirstFrame) and self._asked_for(pdu):
            address = request_identifier(ecu, is_extended_id=is_extended_id)
            self._send(address, _GO_ON, now, is_extended_id=is_extended_id)
        reassembly = self._reassemblies.setdefault((ecu, is_extended_id), Reassembly())
        reassembly.receive_pdu(pdu, now)
        self._take_messages(reassembly, ecu, frame.stamp_s, now, is_extended_id=is_extended_id)

    def _asked_for(self, first: n_pdu.FirstFrame) -> bool:
        """Whether it answers us: flow control into another tester's transfer would disturb it."""
        request = self._tester.open_request if self._tester else None
        return request is not None and first.data.startswith(
            bytes([service_01.POSITIVE_RESPONSE, request.pid])
        )

    def _take_messages(
        self, reassembly: Reassembly, ecu: int, stamp_s: float, now: float, *, is_extended_id: bool
    ) -> None:
        while (event := reassembly.next_event()) is not None:
            if isinstance(event, Aborted):
                self._discard(stamp_s, ecu, event.reason, event.detail)
                continue
            try:
                answer = service_01.decode_answer(event.payload)
            except service_01.AnswerError as error:
                self._discard(stamp_s, ecu, error.reason, str(error))
                continue
            if answer is None:
                continue
            if self._tester is not None:
                self._tester.receive_answer(answer, now, is_extended_id=is_extended_id)
            if isinstance(answer, service_01.CurrentData):
                self._receive_data(answer, ecu, stamp_s, is_extended_id=is_extended_id)
            elif answer.response_code != service_01.RESPONSE_PENDING:
                code = f"response code 0x{answer.response_code:02X}"
                self._discard(stamp_s, ecu, "negative_response", code)

    def _receive_data(
        self, answer: service_01.CurrentData, ecu: int, stamp_s: float, *, is_extended_id: bool
    ) -> None:
        data = answer.values.get(service_01.VEHICLE_SPEED)
        if data is None:
            return
        self._speed_heard_at[ecu, is_extended_id] = stamp_s
        if self._is_believed(ecu, stamp_s):
            self._tell_speed(
                Speed(
                    stamp_s=stamp_s,
                    speed_m_s=service_01.speed_m_s(data),
                    resolution_m_s=service_01.SPEED_RESOLUTION_M_S,
                    source=f"obd:{ecu:03X}",
                )
            )

    def _is_believed(self, ecu: int, stamp_s: float) -> bool:
        if (
            self._broadcast_heard_at is not None
            and stamp_s < self._broadcast_heard_at + BROADCAST_FRESH_S
        ):
            return False
        return not any(
            other < ecu and heard_at > stamp_s - ECU_FRESH_S
            for (other, _), heard_at in self._speed_heard_at.items()
        )

    def _tell_speed(self, speed: Speed) -> None:
        self._events.append(speed)
        hard_brake = self._detector.receive_speed(speed)
        if hard_brake is not None:
            self._events.append(hard_brake)

    def _send(self, identifier: int, pdu: n_pdu.NPdu, now: float, *, is_extended_id: bool) -> None:
        self._to_send.append(CanFrame(now, identifier, is_extended_id, n_pdu.encode(pdu)))

    def _discard(self, stamp_s: float, ecu: int, reason: str, detail: str) -> None:
        self._events.append(Discarded(stamp_s, "obd", reason, f"{ecu:03X}: {detail}"))


def is_ecu_answer(identifier: int, *, is_extended_id: bool) -> bool:
    """Whether an ECU answers testers under this identifier."""
    if is_extended_id:
        return identifier & 0x1FFFFF00 == 0x18DAF100
    return 0x7E8 <= identifier <= 0x7EF


def request_identifier(ecu: int, *, is_extended_id: bool) -> int:
    """Identifier that reaches only the ECU that answers under `ecu`."""
    if is_extended_id:
        return 0x18DA00F1 | (ecu & 0xFF) << 8
    return ecu - 8
