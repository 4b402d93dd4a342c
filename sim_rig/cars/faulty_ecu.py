"""What the control units of a scenario's car send, with the faults of ECU and bus, without I/O."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from onboard.obd.can_frame import CanFrame
from onboard.obd.dbc_file import read_dbc
from onboard.observations import Side
from sim_rig.cars.broadcast_unit import BroadcastUnit
from sim_rig.cars.ecu import ENGINE_11_BIT, Ecu
from sim_rig.scenario.faults import EcuBabbles, SpeedScaled
from sim_rig.scenario.schema import Scenario

_REFUSAL = bytes([0x03, 0x7F, 0x01, 0x22]).ljust(8, b"\x55")
"""Negative response to service 01: conditions not correct (ISO 14229-1)."""
_RANDOM_IDS = 0x100
"""First identifier, and number of identifiers, of the babbling node's own frames."""
_BURST_S = 0.005
"""Frames of this time are sent at once."""
_CHECK_INTERVAL_S = 0.1
"""Interval at which the start of the fault is checked."""


class FaultyEcu:
    """An `Ecu` with the faults of the scenario and the signals that other units broadcast."""

    def __init__(
        self,
        scenario: Scenario,
        car: str,
        speed_m_s: Callable[[float], float],
        at_s: Callable[[float], float],
        rng: np.random.Generator,
        *,
        yaw_rate_rad_s: Callable[[float], float] = lambda _now: 0.0,
    ) -> None:
        """Connect the ECU to a car.

        Args:
            scenario: the scenario of the run.
            car: name of the car.
            speed_m_s: true speed of the car at a `now`, m/s.
            at_s: time since the start of the scenario at a `now`, s.
            rng: source of the babbling node's frames, and of when speeds are taken.
            yaw_rate_rad_s: true one of the car at a `now`, positive to the left.
        """
        self._scenario = scenario
        self._car = car
        self._true_speed_m_s = speed_m_s
        self._at_s = at_s
        self._rng = rng
        self._ecu = Ecu(
            self._speed_m_s,
            runs=lambda now: not self._has("ecu_stopped", now),
            answer_after_s=scenario.ecu.answer_s,
        )
        signals = scenario.cars[car].broadcast
        self._broadcast = (
            None
            if signals is None
            else BroadcastUnit(
                signals,
                read_dbc(signals.dbc),
                self._scaled_speed_m_s,
                yaw_rate_rad_s,
                self._signals_to,
            )
        )
        self._refresh_s = scenario.ecu.refresh_s
        self._phase_s = float(rng.uniform(0.0, self._refresh_s)) if self._refresh_s else 0.0
        self._babbles = [
            fault for fault in scenario.faults if isinstance(fault, EcuBabbles) and fault.car == car
        ]
        self._babbles_at = 0.0

    def receive_frame(self, frame: CanFrame, now: float) -> None:
        """Process a frame from the bus."""
        self._ecu.receive_frame(frame, now)

    def frames_to_send(self, now: float) -> list[CanFrame]:
        """Return the frames that are due, in order."""
        frames = self._ecu.frames_to_send(now)
        if self._has("ecu_refuses", now):
            frames = [replace(frame, data=_REFUSAL) for frame in frames]
        if self._broadcast is not None:
            frames += self._broadcast.frames_to_send(now)
        if self._babbles and self._babbles_at <= now:
            frames += self._babble(now)
        return frames

    def get_timer(self) -> float:
        """Return when the next frame is due; `math.inf` when none is."""
        return min(
            self._ecu.get_timer(),
            self._babbles_at if self._babbles else math.inf,
            self._broadcast.get_timer() if self._broadcast is not None else math.inf,
        )

    def _babble(self, now: float) -> list[CanFrame]:
        at_s = self._at_s(now)
        rate_hz = sum(fault.rate_hz for fault in self._babbles if fault.holds(self._car, at_s))
        if rate_hz == 0.0:
            self._babbles_at = now + _CHECK_INTERVAL_S
            return []
        self._babbles_at = now + max(_BURST_S, 1.0 / rate_hz)
        return [self._random_frame(now) for _ in range(max(1, round(rate_hz * _BURST_S)))]

    def _random_frame(self, now: float) -> CanFrame:
        """A frame of random data; one in four has the identifier of the ECU's responses."""
        own_id = _RANDOM_IDS + int(self._rng.integers(_RANDOM_IDS))
        identifier = ENGINE_11_BIT.response if self._rng.integers(4) == 0 else own_id
        return CanFrame(now, identifier, is_extended_id=False, data=self._rng.bytes(8))

    def _speed_m_s(self, now: float) -> float:
        """What the ECU answers: the speed that it took last."""
        if self._refresh_s:
            now -= (now - self._phase_s) % self._refresh_s
        return self._scaled_speed_m_s(now)

    def _scaled_speed_m_s(self, now: float) -> float:
        at_s, speed_m_s = self._at_s(now), self._true_speed_m_s(now)
        for fault in self._scenario.faults:
            if isinstance(fault, SpeedScaled) and fault.holds(self._car, at_s):
                speed_m_s *= fault.factor
        return speed_m_s

    def _signals_to(self, side: Side, now: float) -> bool:
        at_s = self._at_s(now)
        signals = self._scenario.cars[self._car].turn_signals
        return any(each.side == side and each.from_s <= at_s < each.until_s for each in signals)

    def _has(self, what: str, now: float) -> bool:
        return self._scenario.has_fault(what, self._car, self._at_s(now))
