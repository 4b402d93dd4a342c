"""The core of the vehicle's bus: requests the speed, decodes broadcasts, detects hard braking.

Addresses of ISO 15765-4: a functional request goes to every ECU; each ECU responds with its own
identifier, and receives flow control for a long response under another one.

              functional   ECU responds              to one ECU
    11 bits   0x7DF        0x7E8 ... 0x7EF           response's - 8
    29 bits   0x18DB33F1   0x18DAF1xx                0x18DAxxF1
"""

from collections import deque
from typing import TYPE_CHECKING

from typing_extensions import override

from onboard.core import Core
from onboard.obd import n_pdu, service_01
from onboard.obd.braking import BrakeTrigger, Braking
from onboard.obd.can_frame import CanFrame
from onboard.obd.iso_tp import Aborted, Reassembly
from onboard.obd.request_scheduler import RequestScheduler
from onboard.obd.settings import ObdSettings
from onboard.observations import (
    BrakePedal,
    Discarded,
    HardBrake,
    Speed,
    Steering,
    TurnSignal,
    YawRate,
)

if TYPE_CHECKING:
    from onboard.obd.broadcast import BroadcastSignals, BroadcastValue

FUNCTIONAL_11_BIT = 0x7DF
FUNCTIONAL_29_BIT = 0x18DB33F1

ECU_FRESH_S = 1.0
"""Silence after which another ECU's speed is used: of several ECUs, that with the lowest identifier
(the engine's, in practice) is."""

BROADCAST_FRESH_S = 0.5
"""Time for which a broadcast speed pauses OBD requests: two scales would look like braking."""

_CONTINUE_TO_SEND = n_pdu.FlowControl(n_pdu.FlowStatus.CONTINUE_TO_SEND, block_size=0, st_min=0)
"""Flow control of a tester (ISO 15765-4)."""
_OVERFLOW = n_pdu.FlowControl(n_pdu.FlowStatus.OVERFLOW, block_size=0, st_min=0)
"""For a message that is longer than is taken (ISO 15765-2): its sender ends it."""

_IDENTIFIERS = {"auto": (False, True), "11-bit": (False,), "29-bit": (True,)}

BusEvent = Speed | BrakePedal | TurnSignal | YawRate | Steering | HardBrake | Discarded


class VehicleBus(Core):
    """The core of the vehicle's bus; its state is bounded: one reassembly for each ECU at most."""

    def __init__(self, settings: ObdSettings, signals: "BroadcastSignals | None" = None) -> None:
        """Start with nothing received.

        Args:
            settings: what to request.
            signals: those that the vehicle broadcasts; `None` if none are known.
        """
        self._scheduler = (
            RequestScheduler(settings.polling_hz, _IDENTIFIERS[settings.addressing])
            if settings.polling_hz is not None
            else None
        )
        self._signals = signals
        self._braking = Braking(settings.hard_brake_threshold_g)
        self._reassemblies: dict[tuple[int, bool], Reassembly] = {}
        self._speed_received_at: dict[tuple[int, bool], float] = {}
        self._broadcast_received_at: float | None = None
        self._to_send: deque[CanFrame] = deque()
        self._events: deque[BusEvent] = deque()

    def receive_frame(self, frame: CanFrame, now: float) -> None:
        """Receive a frame of the bus; only OBD responses and named signals are used."""
        if self._signals is not None:
            for observation in self._signals.receive_frame(frame):
                self._receive_broadcast(observation, now)
        if is_ecu_response(frame.arbitration_id, is_extended_id=frame.is_extended_id):
            self._receive_from_ecu(frame, now)

    def frames_to_send(self, now: float) -> list[CanFrame]:
        """Requests and flow control that are due."""
        for request in self._scheduler.requests_to_send(now) if self._scheduler else ():
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
        """Return when a request, a frame of a long response, or the end of braking is due."""
        timers = [reassembly.get_timer() for reassembly in self._reassemblies.values()]
        timers.append(self._braking.get_timer())
        if self._scheduler is not None:
            timers.append(self._scheduler.get_timer())
        return min(timers)

    @override
    def handle_timer(self, now: float) -> None:
        """Abort responses that timed out; end braking. Requests are due in `frames_to_send`."""
        self._braking.handle_timer(now)
        self._take_braking()
        for (ecu, is_extended_id), reassembly in self._reassemblies.items():
            reassembly.handle_timer(now)
            self._take_messages(reassembly, ecu, now, now, is_extended_id=is_extended_id)

    @override
    def next_event(self) -> BusEvent | None:
        """The oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def _receive_broadcast(self, observation: "BroadcastValue", now: float) -> None:
        match observation:
            case Speed():
                self._broadcast_received_at = observation.stamp_s
                if self._scheduler is not None:
                    self._scheduler.pause_until(now + BROADCAST_FRESH_S)
                self._report_speed(observation, now)
            case BrakeTrigger():
                self._braking.receive_trigger(observation, now)
            case BrakePedal():
                self._events.append(observation)
                self._braking.receive_pedal(observation, now)
            case _:
                self._events.append(observation)
        self._take_braking()

    def _receive_from_ecu(self, frame: CanFrame, now: float) -> None:
        ecu, is_extended_id = frame.arbitration_id, frame.is_extended_id
        try:
            pdu = n_pdu.decode(frame.data)
        except n_pdu.NPduError as error:
            self._discard(frame.stamp_s, ecu, error.reason, str(error))
            return
        if isinstance(pdu, n_pdu.FirstFrame) and self._is_to_own_request(pdu):
            address = request_identifier(ecu, is_extended_id=is_extended_id)
            is_taken = pdu.length <= n_pdu.MAX_FIRST_FRAME_12_BIT
            flow_control = _CONTINUE_TO_SEND if is_taken else _OVERFLOW
            self._send(address, flow_control, now, is_extended_id=is_extended_id)
        reassembly = self._reassemblies.setdefault((ecu, is_extended_id), Reassembly())
        reassembly.receive_pdu(pdu, now)
        self._take_messages(reassembly, ecu, frame.stamp_s, now, is_extended_id=is_extended_id)

    def _is_to_own_request(self, first: n_pdu.FirstFrame) -> bool:
        """Whether it is the response to the unanswered request.

        Flow control into another tester's transfer would disturb that.
        """
        request = self._scheduler.unanswered_request if self._scheduler else None
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
                response = service_01.decode_response(event.payload)
            except service_01.ResponseError as error:
                self._discard(stamp_s, ecu, error.reason, str(error))
                continue
            if response is None:
                continue
            if self._scheduler is not None:
                self._scheduler.receive_response(response, now, is_extended_id=is_extended_id)
            if isinstance(response, service_01.PositiveResponse):
                self._receive_data(response, ecu, stamp_s, now, is_extended_id=is_extended_id)
            elif response.response_code != service_01.RESPONSE_PENDING:
                code = f"response code 0x{response.response_code:02X}"
                self._discard(stamp_s, ecu, "negative_response", code)

    def _receive_data(
        self,
        response: service_01.PositiveResponse,
        ecu: int,
        stamp_s: float,
        now: float,
        *,
        is_extended_id: bool,
    ) -> None:
        data = response.values.get(service_01.VEHICLE_SPEED)
        if data is None:
            return
        self._speed_received_at[ecu, is_extended_id] = stamp_s
        speed = Speed(
            stamp_s=stamp_s,
            speed_m_s=service_01.speed_m_s(data),
            resolution_m_s=service_01.SPEED_RESOLUTION_M_S,
            source=f"obd:{ecu:03X}",
        )
        if self._is_preferred(ecu, stamp_s):
            self._report_speed(speed, now)
        else:
            self._braking.receive_other_speed(speed, now)
            self._take_braking()

    def _is_preferred(self, ecu: int, stamp_s: float) -> bool:
        if (
            self._broadcast_received_at is not None
            and stamp_s < self._broadcast_received_at + BROADCAST_FRESH_S
        ):
            return False
        return not any(
            other < ecu and received_at > stamp_s - ECU_FRESH_S
            for (other, _), received_at in self._speed_received_at.items()
        )

    def _report_speed(self, speed: Speed, now: float) -> None:
        self._events.append(speed)
        self._braking.receive_speed(speed, now)
        self._take_braking()

    def _take_braking(self) -> None:
        while (brake := self._braking.next_event()) is not None:
            self._events.append(brake)

    def _send(self, identifier: int, pdu: n_pdu.NPdu, now: float, *, is_extended_id: bool) -> None:
        self._to_send.append(CanFrame(now, identifier, is_extended_id, n_pdu.encode(pdu)))

    def _discard(self, stamp_s: float, ecu: int, reason: str, detail: str) -> None:
        self._events.append(Discarded(stamp_s, "obd", reason, f"{ecu:03X}: {detail}"))


def is_ecu_response(identifier: int, *, is_extended_id: bool) -> bool:
    """Whether ECUs respond to testers under this identifier."""
    if is_extended_id:
        return identifier & 0x1FFFFF00 == 0x18DAF100
    return 0x7E8 <= identifier <= 0x7EF


def is_diagnostic(identifier: int, *, is_extended_id: bool) -> bool:
    """Whether testers or ECUs use this identifier (ISO 15765-4)."""
    if is_extended_id:
        return identifier & 0x1FFF0000 in (0x18DA0000, 0x18DB0000)
    return 0x7DF <= identifier <= 0x7EF


def request_identifier(ecu: int, *, is_extended_id: bool) -> int:
    """Identifier that addresses only the ECU that responds under `ecu`."""
    if is_extended_id:
        return 0x18DA00F1 | (ecu & 0xFF) << 8
    return ecu - 8
