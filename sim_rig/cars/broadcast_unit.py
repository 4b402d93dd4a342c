"""A control unit that broadcasts what a DBC file names of a car, without I/O."""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from onboard.obd.broadcast import ANGLE_UNITS, SPEED_UNITS, BroadcastSignals
from onboard.obd.can_frame import CanFrame
from onboard.obd.dbc_database import parse_dbc
from onboard.obd.settings import BroadcastSettings
from onboard.observations import Side

DEFAULT_CYCLE_S = 0.02
"""Interval of a message for which the DBC file states none (`GenMsgCycleTime`)."""
PEDAL_M_S2 = 1.0
"""Deceleration from which the pedal is pressed: engines brake with less."""
_SLOPE_S = 0.05
"""Time over which the deceleration is taken."""


class BroadcastUnit:
    """Sends each message that has a named signal at its rate; other signals of it are 0."""

    def __init__(
        self,
        settings: BroadcastSettings,
        dbc_text: str,
        speed_m_s: Callable[[float], float],
        yaw_rate_rad_s: Callable[[float], float] = lambda _now: 0.0,
        signals_to: Callable[[Side, float], bool] = lambda _side, _now: False,
    ) -> None:
        """Connect the unit to a car.

        Args:
            settings: names of the signals.
            dbc_text: content of the DBC file.
            speed_m_s: speed of the car at a `now`, m/s.
            yaw_rate_rad_s: of the car, positive to the left (ISO 8855), whatever the settings say.
            signals_to: whether the car's turn signal of a side is on at a `now`.

        Raises:
            UserError: as `BroadcastSignals`.
        """
        BroadcastSignals(settings, dbc_text)  # refuses names that are not in the file
        self._speed_m_s = speed_m_s
        self._yaw_rate_rad_s = yaw_rate_rad_s
        self._steering_m = settings.steering_m
        self._angle_unit = settings.angle_unit
        self._values: dict[tuple[str, str], Callable[[Any, float], float]] = {
            _split(name): self._speed(settings.speed_unit) for name in settings.speed
        }
        if settings.brake_pedal is not None:
            self._values[_split(settings.brake_pedal)] = self._pedal
        for name, angle in (
            (settings.yaw_rate, self._yaw_rate_rad_s),
            (settings.steering_angle, self._steering_rad),
        ):
            if name is not None:
                self._values[_split(name)] = self._angle(angle)
        levers: tuple[tuple[Side, str | None], ...] = (
            ("left", settings.turn_signal_left),
            ("right", settings.turn_signal_right),
        )
        for side, name in levers:
            if name is not None:
                self._values[_split(name)] = _lever(partial(signals_to, side))
        named = {message for message, _ in self._values}
        database = parse_dbc(dbc_text, str(settings.dbc))
        self._messages = [message for message in database.messages if message.name in named]
        self._due_at = [0.0] * len(self._messages)

    def frames_to_send(self, now: float) -> list[CanFrame]:
        """Return the frames that are due."""
        frames = []
        for i, message in enumerate(self._messages):
            if self._due_at[i] > now:
                continue
            cycle_s = (message.cycle_time or 0) / 1000.0 or DEFAULT_CYCLE_S
            # A late one is sent once, and the next ones keep their phase.
            self._due_at[i] += cycle_s * (math.floor((now - self._due_at[i]) / cycle_s) + 1)
            if self._due_at[i] <= now:  # by rounding
                self._due_at[i] += cycle_s
            data = message.encode(self._content(message, now), strict=False)
            frames.append(CanFrame(now, message.frame_id, message.is_extended_frame, data))
        return frames

    def get_timer(self) -> float:
        """Return when the next frame is due; `math.inf` if there is none."""
        return min(self._due_at, default=math.inf)

    def _content(self, message: Any, now: float) -> Mapping[str, float]:
        content = {}
        for signal in message.signals:
            value = self._values.get((message.name, signal.name))
            content[signal.name] = 0.0 if value is None else _within(signal, value(signal, now))
        return content

    def _speed(self, unit: str | None) -> Callable[[Any, float], float]:
        def value(signal: Any, now: float) -> float:
            return self._speed_m_s(now) / SPEED_UNITS[(unit or signal.unit).lower()]

        return value

    def _angle(self, angle: Callable[[float], float]) -> Callable[[Any, float], float]:
        def value(signal: Any, now: float) -> float:
            return angle(now) / ANGLE_UNITS[(self._angle_unit or signal.unit).lower()]

        return value

    def _steering_rad(self, now: float) -> float:
        return self._steering_m * self._yaw_rate_rad_s(now) / max(self._speed_m_s(now), 1.0)

    def _pedal(self, _signal: Any, now: float) -> float:
        slope_m_s2 = (self._speed_m_s(now) - self._speed_m_s(now - _SLOPE_S)) / _SLOPE_S
        return float(slope_m_s2 <= -PEDAL_M_S2)


def _lever(is_on: Callable[[float], bool]) -> Callable[[Any, float], float]:
    return lambda _signal, now: float(is_on(now))


def _within(signal: Any, value: float) -> float:
    """The nearest value that the signal's bits can carry."""
    codes = 1 << signal.length
    lowest = -codes // 2 if signal.is_signed else 0
    ends = [float(signal.offset + signal.scale * code) for code in (lowest, lowest + codes - 1)]
    return min(max(value, min(ends)), max(ends))


def _split(name: str) -> tuple[str, str]:
    message, _, signal = name.partition(".")
    return message, signal
