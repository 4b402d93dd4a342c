"""A request to brake as a CAN frame, laid out by the DBC file of the vehicle's controller."""

from collections.abc import Iterator
from typing import Any

import cantools

from onboard.brake_request.brake_requester import BrakeRequest
from onboard.brake_request.settings import RequestFrameSettings
from onboard.errors import UserError
from onboard.obd.can_frame import CanFrame
from onboard.obd.dbc_database import parse_dbc
from onboard.obd.dbc_excerpt import excerpt
from onboard.obd.vehicle_bus import is_diagnostic

_DECELERATION_UNITS = frozenset({"m/s^2", "m/s2", "m/s²"})
_CERTAINTY_FACTORS = {"": 1.0, "1": 1.0, "%": 100.0}
_MOST_BYTES = 8


class RequestFrameLayout:
    """Encodes requests as the named signals; all other bits of the frame are 0."""

    def __init__(self, settings: RequestFrameSettings, dbc_text: str, most_m_s2: float) -> None:
        """Find the named signals.

        Args:
            settings: names of the signals.
            dbc_text: content of the DBC file in Latin-1, as it is read from disk.
            most_m_s2: hardest braking that is requested.

        Raises:
            UserError: a signal is not in the DBC file, is in another message, or cannot hold the
                values.
        """
        self._dbc = settings.dbc
        self._names = {
            role: name for role in _ROLES if (name := getattr(settings, role)) is not None
        }
        self._message = self._find(dbc_text)
        self._signals = {
            role: self._message.get_signal_by_name(name.partition(".")[2])
            for role, name in self._names.items()
        }
        for role, problem in self._problems():
            raise UserError(f"brake_request.can.{role}: {self._names[role]} {problem}")
        for deceleration_m_s2, certainty in ((0.0, 0.0), (most_m_s2, 1.0)):
            try:
                self.frame(BrakeRequest(0.0, deceleration_m_s2, certainty, 0.0, 0, ()))
            except cantools.database.EncodeError as error:
                raise UserError(f"{self._dbc}: {' '.join(str(error).split())}") from error

    def frame(self, request: BrakeRequest) -> CanFrame:
        """Return the frame of a request."""
        values: dict[str, float] = {
            "deceleration": request.deceleration_m_s2,
            "certainty": request.certainty,
            "is_requested": request.deceleration_m_s2 > 0.0,
            "counter": request.counter,
            "checksum": 0,
        }
        if (certainty := self._signals.get("certainty")) is not None:
            values["certainty"] *= _CERTAINTY_FACTORS[certainty.unit or ""]
        if (counter := self._signals.get("counter")) is not None:
            values["counter"] %= 1 << counter.length
        data = self._encode(values)
        if "checksum" in self._signals:
            data = self._encode(values | {"checksum": crc8_j1850(data)})
        message = self._message
        return CanFrame(request.stamp_s, message.frame_id, message.is_extended_frame, data)

    def _encode(self, values: dict[str, float]) -> bytes:
        named = {signal.name: values[role] for role, signal in self._signals.items()}
        encoded: bytes = self._message.encode(named)
        return encoded

    def _find(self, dbc_text: str) -> Any:
        """Return the message, with the named signals only."""
        text = excerpt(dbc_text, self._names.values())
        if text is None:
            names = ", ".join(self._names.values())
            raise UserError(f"{self._dbc}: not each of {names} is declared once")
        database = parse_dbc(text, str(self._dbc))
        if len(database.messages) > 1:
            names = ", ".join(message.name for message in database.messages)
            raise UserError(
                f"{self._dbc}: the signals of a request are in several messages: {names}"
            )
        message = database.messages[0]
        if message.length > _MOST_BYTES or message.is_multiplexed():
            raise UserError(f"{self._dbc}: {message.name} is multiplexed, or longer than 8 bytes")
        if is_diagnostic(message.frame_id, is_extended_id=message.is_extended_frame):
            raise UserError(
                f"{self._dbc}: {message.name} has 0x{message.frame_id:X}, an identifier of OBD"
            )
        return message

    def _problems(self) -> Iterator[tuple[str, str]]:
        """Yield what is wrong with signals, by role."""
        for role, signal in self._signals.items():
            is_plain = not signal.is_float and signal.scale == 1 and signal.offset == 0
            match role:
                case "deceleration" if signal.unit not in _DECELERATION_UNITS:
                    yield role, f"has the unit {signal.unit!r}; allowed: m/s^2"
                case "certainty" if (signal.unit or "") not in _CERTAINTY_FACTORS:
                    yield role, f"has the unit {signal.unit!r}; allowed: none, %"
                case "checksum" if not (is_plain and signal.length == 8 and not signal.is_signed):
                    yield role, "is not an unsigned byte"
                case "counter" | "is_requested" if not is_plain or signal.is_signed:
                    yield role, "is not an unsigned whole number"


_ROLES = ("deceleration", "certainty", "is_requested", "counter", "checksum")


def crc8_j1850(data: bytes) -> int:
    """Return the CRC-8 of SAE J1850: polynomial 0x1D, initial value and final inversion 0xFF."""
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x1D if crc & 0x80 else crc << 1) & 0xFF
    return crc ^ 0xFF
