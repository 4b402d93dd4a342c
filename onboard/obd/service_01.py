"""OBD-II service 01, "request current powertrain diagnostic data" (SAE J1979, ISO 15031-5)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from onboard.kinematics.units import KM_H

SERVICE: Final = 0x01
POSITIVE_RESPONSE: Final = 0x41
NEGATIVE_RESPONSE: Final = 0x7F

RESPONSE_PENDING: Final = 0x78
"""Negative response code: the response follows later."""

SUPPORTED_PIDS: Final = 0x00
VEHICLE_SPEED: Final = 0x0D

SPEED_RESOLUTION_M_S: Final = KM_H
"""Resolution of PID 0x0D: whole km/h, 0 to 255."""

_PIDS_BY_LENGTH: Final[Mapping[int, str]] = {
    1: "04 05 06 07 08 09 0A 0B 0D 0E 0F 11 12 13 1C 1D 1E 2C 2D 2E 2F 30 33 45 46 47 48 49 4A 4B"
    "  4C 51 52 55 56 57 58 5A 5B 5C 5F 61 62",
    2: "02 03 0C 10 14 15 16 17 18 19 1A 1B 1F 21 22 23 31 32 3C 3D 3E 3F 42 43 44 4D 4E 53 54 59"
    "  5D 5E 63",
    4: "00 01 20 24 25 26 27 28 29 2A 2B 34 35 36 37 38 39 3A 3B 40 41 4F 50 60 80 A0 A4 A6 C0",
}

PID_LENGTHS: Final[Mapping[int, int]] = {
    int(pid, 16): length for length, pids in _PIDS_BY_LENGTH.items() for pid in pids.split()
}
"""Data bytes of each PID (SAE J1979, appendix B), by which a response about several is split."""


class ResponseError(Exception):
    """A response to service 01 that contradicts itself; `reason` is an identifier."""

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(detail)
        self.reason = reason


@dataclass(frozen=True, slots=True)
class PositiveResponse:
    """A positive response: the raw data bytes by PID."""

    values: Mapping[int, bytes]


@dataclass(frozen=True, slots=True)
class NegativeResponse:
    """A negative response to service 01."""

    response_code: int
    """ISO 14229-1, annex A: 0x11 service not supported, 0x12 sub-function not supported ..."""


def request(pid: int) -> bytes:
    """The message that requests one PID."""
    return bytes([SERVICE, pid])


def decode_response(payload: bytes) -> PositiveResponse | NegativeResponse | None:
    """Decode one message from an ECU; `None` if it is about another service.

    Raises:
        ResponseError: with reason `pid_length`, `pid_twice` or `negative_response_length`.
    """
    if payload[0] == NEGATIVE_RESPONSE:
        if len(payload) != 3:
            raise ResponseError("negative_response_length", f"{len(payload)} bytes")
        return NegativeResponse(payload[2]) if payload[1] == SERVICE else None
    if payload[0] != POSITIVE_RESPONSE:
        return None
    return PositiveResponse(_split(payload[1:]))


def speed_m_s(data: bytes) -> float:
    """Value of PID 0x0D."""
    return data[0] * KM_H


def supported_pids(base: int, data: bytes) -> frozenset[int]:
    """PIDs in the bitmap of PID `base` (0x00, 0x20, 0x40 ...)."""
    bits = int.from_bytes(data, "big")
    return frozenset(base + n for n in range(1, 33) if bits >> (32 - n) & 1)


def _split(rest: bytes) -> dict[int, bytes]:
    """Data by PID, of up to six in one response; an unlisted PID takes all that follows."""
    values: dict[int, bytes] = {}
    while rest:
        pid, data = rest[0], rest[1:]
        length = PID_LENGTHS.get(pid, max(len(data), 1))
        if len(data) < length:
            raise ResponseError("pid_length", f"PID 0x{pid:02X}: {len(data)} of {length} bytes")
        if pid in values:
            raise ResponseError("pid_twice", f"PID 0x{pid:02X}")
        values[pid] = data[:length]
        rest = data[length:]
    if not values:
        raise ResponseError("pid_length", "no PID")
    return values
