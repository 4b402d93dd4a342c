"""Signals that the vehicle broadcasts, decoded by its DBC file and named in the settings."""

import math
import statistics
from collections.abc import Iterator, Mapping
from typing import Any

import cantools

from onboard.errors import UserError
from onboard.kinematics.units import KM_H, MPH
from onboard.obd.braking import BrakeTrigger
from onboard.obd.can_frame import CanFrame
from onboard.obd.dbc_database import parse_dbc
from onboard.obd.dbc_excerpt import excerpt
from onboard.obd.settings import BroadcastSettings
from onboard.observations import (
    BrakeCause,
    BrakePedal,
    Discarded,
    Side,
    Speed,
    Steering,
    TurnSignal,
    YawRate,
)

SPEED_UNITS: Mapping[str, float] = {
    "m/s": 1.0,
    "mps": 1.0,
    "km/h": KM_H,
    "kmh": KM_H,
    "kph": KM_H,
    "kmph": KM_H,
    "km/hour": KM_H,
    "mph": MPH,
}
"""Units of speed as written in DBC files, in lower case."""

_DEG = math.radians(1.0)
ANGLE_UNITS: Mapping[str, float] = {
    **dict.fromkeys(("deg", "degree", "degrees", "°"), _DEG),
    **dict.fromkeys(("deg/s", "deg/sec", "degree/s", "degrees/s", "°/s"), _DEG),
    **dict.fromkeys(("rad", "rad/s", "rad/sec"), 1.0),
}
"""Units of angles in rad, and of yaw rates in rad/s, in lower case."""

_PRESSURE_UNITS: Mapping[str, float] = {"bar": 1.0, "kpa": 0.01, "mpa": 10.0}
"""Units of pressure in bar, in lower case."""

BroadcastValue = Speed | BrakePedal | TurnSignal | YawRate | Steering | BrakeTrigger | Discarded

HIGHEST_SPEED_M_S = 100.0
"""Highest plausible speed: many DBC files state no range, or that of all bits, and higher values
are codes such as "not available"."""


class BroadcastSignals:
    """Decodes frames with the named signals to observations."""

    def __init__(self, settings: BroadcastSettings, dbc_text: str) -> None:
        """Find the named signals.

        Args:
            settings: names of the signals.
            dbc_text: content of the DBC file, as `onboard.obd.dbc_file` reads it.

        Raises:
            UserError: the text is no DBC file, a signal is not in it or badly declared, speeds are
                spread over several messages, or a speed or pressure has no known unit.
        """
        self.dbc_text = dbc_text
        self._dbc = settings.dbc
        database = parse_dbc(excerpt(dbc_text, _names(settings)) or dbc_text, str(self._dbc))
        self._speed = [self._find(database, name) for name in settings.speed]
        self._pedal = [
            self._find(database, name) for name in (settings.brake_pedal,) if name is not None
        ]
        turn_signals: tuple[tuple[Side, str | None], ...] = (
            ("left", settings.turn_signal_left),
            ("right", settings.turn_signal_right),
        )
        self._turn_signals = [
            (side, *self._find(database, name)) for side, name in turn_signals if name is not None
        ]
        if len({message.name for message, _ in self._speed}) > 1:
            raise UserError(
                f"obd.broadcast.speed: {', '.join(settings.speed)} belong to several messages; "
                "name the signals of one"
            )
        if self._speed:
            name, unit = settings.speed[0], settings.speed_unit or self._speed[0][1].unit
            self._factor = self._factor_of(
                name, unit, SPEED_UNITS, "speed_unit to km/h, m/s or mph"
            )
        self._turns = list(self._find_turns(database, settings))
        self._triggers = list(self._find_triggers(database, settings))
        lamps = [found for _, *found in self._turn_signals]
        self._messages = {
            (message.frame_id, message.is_extended_frame): message
            for message, *_ in (*self._speed, *self._pedal, *lamps, *self._turns, *self._triggers)
        }

    def receive_frame(self, frame: CanFrame) -> list[BroadcastValue]:
        """Observations of the named signals in the frame; empty if it carries none of them."""
        message = self._messages.get((frame.arbitration_id, frame.is_extended_id))
        if message is None:
            return []
        try:
            values = message.decode(frame.data, decode_choices=False, scaling=True)
        except (cantools.database.DecodeError, ValueError) as error:
            return [_discarded(frame, "signal_decoding", f"{message.name}: {error}")]
        observations: list[BroadcastValue] = []
        speeds = [signal for owner, signal in self._speed if owner is message]
        # A multiplexed signal is in some frames of its message only.
        if speeds and all(signal.name in values for signal in speeds):
            observations.append(self._read_speed(frame, message, speeds, values))
        for owner, signal in self._pedal:
            if owner is message and signal.name in values:
                observations.append(
                    BrakePedal(
                        frame.stamp_s, _is_on(signal, values[signal.name]), _source(owner, signal)
                    )
                )
        for side, owner, signal in self._turn_signals:
            if owner is message and signal.name in values:
                is_on = _is_on(signal, values[signal.name])
                observations.append(TurnSignal(frame.stamp_s, side, is_on, _source(owner, signal)))
        observations += self._read_turns(frame, message, values)
        observations += self._read_triggers(frame, message, values)
        return observations

    def _read_turns(
        self, frame: CanFrame, message: Any, values: Mapping[str, float]
    ) -> Iterator[YawRate | Steering | Discarded]:
        for owner, signal, kind, factor in self._turns:
            if owner is not message or signal.name not in values:
                continue
            value, source = values[signal.name], _source(owner, signal)
            if math.isfinite(value) and _in_range(signal, value):
                yield kind(frame.stamp_s, factor * value, source)
            else:
                yield _discarded(frame, "signal_range", f"{source} = {value} {signal.unit}")

    def _read_triggers(
        self, frame: CanFrame, message: Any, values: Mapping[str, float]
    ) -> Iterator[BrakeTrigger | Discarded]:
        for owner, signal, cause, threshold in self._triggers:
            if owner is not message or signal.name not in values:
                continue
            value, source = values[signal.name], _source(owner, signal)
            if not (math.isfinite(value) and _in_range(signal, value)):
                yield _discarded(frame, "signal_range", f"{source} = {value} {signal.unit}")
                continue
            is_active = _is_on(signal, value) if threshold is None else value >= threshold
            yield BrakeTrigger(frame.stamp_s, cause, is_active, source)

    def _read_speed(
        self, frame: CanFrame, message: Any, signals: list[Any], values: Mapping[str, float]
    ) -> Speed | Discarded:
        for signal in signals:
            value = values[signal.name]
            if not (_in_range(signal, value) and abs(value) * self._factor <= HIGHEST_SPEED_M_S):
                return _discarded(
                    frame, "signal_range", f"{_source(message, signal)} = {value} {signal.unit}"
                )
        # One wheel that locks, or whose sensor fails, does not change the median of three or four.
        median = statistics.median(values[signal.name] for signal in signals)
        return Speed(
            stamp_s=frame.stamp_s,
            speed_m_s=abs(median) * self._factor,  # signed if the wheel's sensor detects reverse
            resolution_m_s=abs(signals[0].scale) * self._factor,
            source=_source(message, signals[0]),
        )

    def _find(self, database: Any, name: str) -> tuple[Any, Any]:
        message_name, _, signal_name = name.partition(".")
        message = next((m for m in database.messages if m.name == message_name), None)
        if message is None:
            raise UserError(f"{self._dbc}: no message {message_name} (for {name})")
        signal = next((s for s in message.signals if s.name == signal_name), None)
        if signal is None:
            known = ", ".join(s.name for s in message.signals)
            raise UserError(f"{self._dbc}: {message_name} has no signal {signal_name}, but {known}")
        return message, signal

    def _find_turns(
        self, database: Any, settings: BroadcastSettings
    ) -> Iterator[tuple[Any, Any, type[YawRate] | type[Steering], float]]:
        """Message, signal, what it is, and the factor to that, positive to the right."""
        for kind, name, positive, of_1_rad in (
            (YawRate, settings.yaw_rate, settings.yaw_rate_positive, 1.0),
            (
                Steering,
                settings.steering_angle,
                settings.steering_angle_positive,
                1.0 / settings.steering_m,
            ),
        ):
            if name is None:
                continue
            message, signal = self._find(database, name)
            unit = settings.angle_unit or signal.unit
            factor = self._factor_of(name, unit, ANGLE_UNITS, "angle_unit to deg or rad")
            yield message, signal, kind, of_1_rad * (factor if positive == "right" else -factor)

    def _find_triggers(
        self, database: Any, settings: BroadcastSettings
    ) -> Iterator[tuple[Any, Any, BrakeCause, float | None]]:
        """Message, signal, cause, and for the pressure its threshold in the signal's unit."""
        for cause, name in (
            (BrakeCause.ABS, settings.abs),
            (BrakeCause.STABILITY_CONTROL, settings.stability_control),
            (BrakeCause.AIRBAG, settings.airbag),
            (BrakeCause.HAZARD_LIGHTS, settings.hazard_lights),
        ):
            if name is not None:
                yield *self._find(database, name), cause, None
        name, threshold_bar = settings.brake_pressure, settings.brake_pressure_threshold_bar
        if name is not None and threshold_bar is not None:
            message, signal = self._find(database, name)
            unit = settings.brake_pressure_unit or signal.unit
            factor = self._factor_of(
                name, unit, _PRESSURE_UNITS, "brake_pressure_unit to bar, kPa or MPa"
            )
            yield message, signal, BrakeCause.BRAKE_PRESSURE, threshold_bar / factor

    def _factor_of(
        self, name: str, unit: str | None, units: Mapping[str, float], remedy: str
    ) -> float:
        factor = units.get((unit or "").lower())
        if factor is None:
            raise UserError(
                f"{self._dbc}: {name} has the unit {unit or ''!r}; set obd.broadcast.{remedy}"
            )
        return factor


def _names(settings: BroadcastSettings) -> list[str]:
    single = (
        settings.brake_pedal,
        settings.turn_signal_left,
        settings.turn_signal_right,
        settings.yaw_rate,
        settings.steering_angle,
        settings.abs,
        settings.stability_control,
        settings.airbag,
        settings.hazard_lights,
        settings.brake_pressure,
    )
    return [*settings.speed, *filter(None, single)]


def _in_range(signal: Any, value: float) -> bool:
    """Whether the value is in the DBC's range; outside are codes such as "not available"."""
    above = signal.minimum is None or value >= signal.minimum
    below = signal.maximum is None or value <= signal.maximum
    return above and below


def _is_on(signal: Any, value: float) -> bool:
    """Whether a flag is set; of two bits, 2 is an error and 3 not available (SAE J1939-71)."""
    return value == 1 if signal.length == 2 else value != 0


def _source(message: Any, signal: Any) -> str:
    return f"dbc:{message.name}.{signal.name}"


def _discarded(frame: CanFrame, reason: str, detail: str) -> Discarded:
    return Discarded(stamp_s=frame.stamp_s, component="obd", reason=reason, detail=detail)
