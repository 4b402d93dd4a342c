"""What breaks on the way, and when: the faults that a scenario can order."""

from typing import Annotated, Literal

from pydantic import Field

from onboard.settings import Settings
from sim_rig.scenario.field_types import CarName, PlateText, Seconds

_INSTANT_S = 1e-6
"""Rounding must not have anybody sleep on."""


class _Fault(Settings):
    car: CarName
    """The car it happens to."""
    from_s: Seconds
    until_s: Seconds
    """When it is whole again."""

    def holds(self, car: str, at_s: float) -> bool:
        """Whether `car` has this fault at `at_s`."""
        return self.car == car and self.from_s <= at_s < self.until_s


class SensorFault(_Fault):
    """A wire fails as a whole."""

    what: Literal[
        "ecu_stopped",
        "ecu_refuses",
        "camera_frozen",
        "camera_dark",
        "gnss_silent",
        "radio_mute",
        "radio_gone",
    ]
    """The ECU is silent, nobody answers on the bus; it refuses every request; the camera repeats
    its last picture; the camera delivers black pictures; the receiver says nothing; the radio hears
    and is not heard; it does neither."""


class EcuBabbles(_Fault):
    """Something on the bus talks without end: frames of its own, and nonsense in the ECU's name."""

    what: Literal["ecu_babbles"]
    rate_hz: float = Field(gt=0.0, le=8000.0)
    """Frames a second; a bus of 500 kbit/s carries some 4000."""


class SpeedScaled(_Fault):
    """The ECU tells a speed in a wrong scale."""

    what: Literal["speed_scaled"]
    factor: float = Field(ge=0.0, le=10.0)


class PlateMisread(_Fault):
    """The camera of `car` sees another text on the plate of the car `of`."""

    what: Literal["plate_misread"]
    of: CarName
    reads: PlateText
    rate: float = Field(gt=0.0, le=1.0)
    """Part of the frames in which it happens."""


class GnssJump(_Fault):
    """The receiver is sure of a place where the car is not."""

    what: Literal["gnss_jump"]
    east_m: float = 0.0
    north_m: float = 0.0


class WrongClock(_Fault):
    """The box's UTC is wrong; its monotonic clock, which the cores go by, is not."""

    what: Literal["clock_wrong"]
    skew_s: float = Field(default=0.0, ge=-1e6, le=1e6)
    """Ahead of the true one when it begins."""
    drift_ppm: float = Field(default=0.0, ge=-1e5, le=1e5)
    """How much further ahead it gets."""

    def error_s(self, at_s: float) -> float:
        """How far ahead it is at `at_s`."""
        return self.skew_s + self.drift_ppm * 1e-6 * (at_s - self.from_s)


class SlowCpu(_Fault):
    """Something else keeps the box busy: the car gets the processor only part of the time."""

    what: Literal["cpu_slow"]
    share: float = Field(gt=0.0, lt=1.0)
    period_s: float = Field(default=0.2, gt=0.0, le=10.0)

    def wakes_at_s(self, at_s: float) -> float:
        """When it runs again; `at_s` itself while it does."""
        phase_s = (at_s - self.from_s) % self.period_s
        is_awake = phase_s < self.share * self.period_s or phase_s > self.period_s - _INSTANT_S
        return at_s if is_awake else at_s - phase_s + self.period_s


class Attack(_Fault):
    """Whoever owns `car` lies, with its radio and its keys, beside what the car says itself.

    `forged_brake`: a warning to its group, of a brake that never was. `ghost_car`: BSMs of a car
    `ahead_m` ahead of it that brakes hard. `replay`: everything that it heard `delay_s` ago, again.
    """

    what: Literal["forged_brake", "ghost_car", "replay"]
    every_s: float = Field(default=2.0, gt=0.0, le=60.0)
    """How often it forges a brake; the ghost speaks ten times a second, but brakes so often."""
    ahead_m: float = Field(default=25.0, gt=0.0, le=500.0)
    delay_s: float = Field(default=2.0, gt=0.0, le=60.0)
    """Of what is replayed."""


Fault = Annotated[
    SensorFault
    | EcuBabbles
    | SpeedScaled
    | PlateMisread
    | GnssJump
    | WrongClock
    | SlowCpu
    | Attack,
    Field(discriminator="what"),
]
