"""An engine control unit that answers OBD-II requests (SAE J1979 over ISO 15765-4), without I/O.

It supports service 01 with some PIDs, also several in one request, and service 09 PID 02 (the VIN,
in several frames). Unsupported functional requests get no answer, unsupported physical requests a
negative response (J1979, 6.2.4.3).
"""

import heapq
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count

from onboard.kinematics.units import KM_H
from onboard.obd.can_frame import CanFrame

N_BS_S = 1.0
"""Timeout of the sender for flow control (ISO 15765-2:2016, table 16)."""
_MOST_CONSECUTIVE = 1 << 30
_SUB_FUNCTION_NOT_SUPPORTED = 0x12
_SERVICE_NOT_SUPPORTED = 0x11


@dataclass(frozen=True, slots=True)
class Addresses:
    """CAN identifiers of the requests to an ECU and of its responses (ISO 15765-4:2021, 10.3)."""

    functional: int
    physical: int
    response: int
    is_extended_id: bool


ENGINE_11_BIT = Addresses(0x7DF, 0x7E0, 0x7E8, is_extended_id=False)
ENGINE_29_BIT = Addresses(0x18DB33F1, 0x18DA10F1, 0x18DAF110, is_extended_id=True)


@dataclass(slots=True)
class _Answer:
    """The unsent part of a response of several frames."""

    rest: bytes
    sequence: int = 1
    give_up_at: float = 0.0


class Ecu:
    """One control unit."""

    def __init__(
        self,
        speed_m_s: Callable[[float], float],
        runs: Callable[[float], bool] = lambda _now: True,
        addresses: Addresses = ENGINE_11_BIT,
        answer_after_s: float = 0.004,
        vin: str = "1RG0000000000001X",
    ) -> None:
        """Connect the control unit to a car.

        Args:
            speed_m_s: true speed of the car at a `now`, m/s.
            runs: whether the unit works at a `now`.
            addresses: its CAN identifiers.
            answer_after_s: delay of each answer; the standard allows 0.05 s (P2_CAN).
            vin: vehicle identification number.
        """
        self._speed_m_s = speed_m_s
        self._runs = runs
        self._addresses = addresses
        self._answer_after_s = answer_after_s
        self._vin = vin.encode("ascii")
        self._due: list[tuple[float, int, bytes]] = []
        self._order = count()
        self._answer: _Answer | None = None
        self._pids: dict[int, Callable[[float], bytes]] = {
            0x04: lambda _now: bytes([0x60]),
            0x05: lambda _now: bytes([40 + 88]),
            0x0C: self._engine_speed,
            0x0D: lambda now: bytes([self._km_h(now)]),
            0x1C: lambda _now: bytes([0x06]),
        }

    def receive_frame(self, frame: CanFrame, now: float) -> None:
        """Process a frame from the bus."""
        asked = frame.arbitration_id
        addresses = self._addresses
        if frame.is_extended_id != addresses.is_extended_id or not frame.data:
            return
        if not self._runs(now):
            return
        if asked not in (addresses.functional, addresses.physical):
            return
        kind, length = frame.data[0] >> 4, frame.data[0] & 0x0F
        if kind == 0 and 1 <= length < len(frame.data):
            request = frame.data[1 : 1 + length]
            self._respond(self._response(request, asked == addresses.physical, now), now)
        elif kind == 3 and asked == addresses.physical and len(frame.data) >= 3:
            self._go_on(frame.data, now)

    def frames_to_send(self, now: float) -> list[CanFrame]:
        """Return the frames that are due, in order."""
        frames = []
        while self._due and self._due[0][0] <= now:
            _, _, data = heapq.heappop(self._due)
            frames.append(
                CanFrame(
                    stamp_s=now,
                    arbitration_id=self._addresses.response,
                    is_extended_id=self._addresses.is_extended_id,
                    data=data.ljust(8, b"\x55"),
                )
            )
        return frames

    def get_timer(self) -> float:
        """Return when the next frame is due; `math.inf` when none is."""
        return self._due[0][0] if self._due else math.inf

    def _km_h(self, now: float) -> int:
        """PID 0x0D: speed in whole km/h, one byte."""
        return min(255, round(self._speed_m_s(now) / KM_H))

    def _engine_speed(self, now: float) -> bytes:
        """PID 0x0C: engine speed in 0.25 rev/min, proportional to the speed above idle."""
        return round(4 * max(800.0, 80.0 * self._speed_m_s(now))).to_bytes(2)

    def _response(self, request: bytes, was_named: bool, now: float) -> bytes:
        service, pids = request[0], request[1:]
        if service == 0x01:
            values = b"".join(self._values(pids, now))
        elif service == 0x09:
            values = b"\x02\x01" + self._vin if pids[:1] == b"\x02" else b""
        elif was_named:
            return bytes([0x7F, service, _SERVICE_NOT_SUPPORTED])
        else:
            return b""
        if values:
            return bytes([service + 0x40]) + values
        return bytes([0x7F, service, _SUB_FUNCTION_NOT_SUPPORTED]) if was_named else b""

    def _values(self, pids: bytes, now: float) -> Iterator[bytes]:
        for pid in pids:
            if pid % 0x20 == 0 and (pid == 0 or any(known > pid for known in self._pids)):
                yield bytes([pid]) + self._supported(pid)
            elif pid in self._pids:
                yield bytes([pid]) + self._pids[pid](now)

    def _supported(self, base: int) -> bytes:
        """Bit mask of the supported PIDs among the next 32, first PID first (J1979, annex A)."""
        bits = sum(1 << 0x20 - (pid - base) for pid in self._pids if base < pid <= base + 0x20)
        return bits.to_bytes(4)

    def _respond(self, response: bytes, now: float) -> None:
        if not response:
            return
        self._answer = None
        if len(response) <= 7:
            self._schedule(now + self._answer_after_s, bytes([len(response)]) + response)
            return
        first_frame = (0x1000 | len(response)).to_bytes(2) + response[:6]
        at = now + self._answer_after_s
        self._schedule(at, first_frame)
        self._answer = _Answer(response[6:], give_up_at=at + N_BS_S)

    def _go_on(self, flow_control: bytes, now: float) -> None:
        """Handle flow control (ISO 15765-2, 9.6.5): send a block of frames, wait, or stop."""
        status, block_size, st_min = flow_control[0] & 0x0F, flow_control[1], flow_control[2]
        answer = self._answer
        if answer is None or now > answer.give_up_at or status > 1:
            self._answer = None
            return
        answer.give_up_at = now + N_BS_S
        if status == 1:
            return
        at = now
        for _ in range(block_size or _MOST_CONSECUTIVE):
            part, answer.rest = answer.rest[:7], answer.rest[7:]
            self._schedule(at, bytes([0x20 | answer.sequence]) + part)
            answer.sequence = (answer.sequence + 1) % 16
            at += separation_s(st_min)
            if not answer.rest:
                self._answer = None
                return

    def _schedule(self, at: float, data: bytes) -> None:
        heapq.heappush(self._due, (at, next(self._order), data))


def separation_s(st_min: int) -> float:
    """Least separation of consecutive frames, s (ISO 15765-2, 9.6.5.4); 0.127 if reserved."""
    if st_min <= 0x7F:
        return st_min / 1e3
    if 0xF1 <= st_min <= 0xF9:
        return (st_min - 0xF0) / 1e4
    return 0.127
