"""Faults that a scenario can inject."""

from typing import Annotated, Literal

from pydantic import Field

from onboard.settings import Settings
from sim_rig.scenario.field_types import CarName, PlateText, Seconds

_INSTANT_S = 1e-6
"""Tolerance for rounding at the end of a period."""


class _Fault(Settings):
    car: CarName
    """The affected car."""
    from_s: Seconds
    until_s: Seconds
    """End of the fault."""

    def holds(self, car: str, at_s: float) -> bool:
        """Whether `car` has this fault at `at_s`, in s since the start of the scenario."""
        return self.car == car and self.from_s <= at_s < self.until_s


class SensorFault(_Fault):
    """Complete failure of a sensor or of the radio."""

    what: Literal[
        "ecu_stopped",
        "ecu_refuses",
        "camera_frozen",
        "camera_dark",
        "gnss_silent",
        "radio_mute",
        "radio_gone",
    ]
    """In this order: the ECU does not answer; it answers every request negatively; the camera
    repeats its last image; it delivers black images; the GNSS receiver sends nothing; the radio
    receives and does not transmit; it does neither."""


class EcuBabbles(_Fault):
    """A node floods the bus with random frames, a quarter of them under the ECU's identifier."""

    what: Literal["ecu_babbles"]
    rate_hz: float = Field(gt=0.0, le=8000.0)
    """A bus of 500 kbit/s carries some 4000 frames a second."""


class SpeedScaled(_Fault):
    """The ECU reports the speed multiplied by `factor`."""

    what: Literal["speed_scaled"]
    factor: float = Field(ge=0.0, le=10.0)


class PlateMisread(_Fault):
    """The camera of `car` shows the text `reads` on the plate of the car `of`."""

    what: Literal["plate_misread"]
    of: CarName
    reads: PlateText
    rate: float = Field(gt=0.0, le=1.0)
    """Share of the affected images."""


class GnssJump(_Fault):
    """The GNSS receiver reports a position that is offset, with unchanged accuracy."""

    what: Literal["gnss_jump"]
    east_m: float = 0.0
    north_m: float = 0.0


class WrongClock(_Fault):
    """The UTC of the car's computer is wrong; its monotonic clock is right."""

    what: Literal["clock_wrong"]
    skew_s: float = Field(default=0.0, ge=-1e6, le=1e6)
    """Error at the start of the fault; positive when the clock is ahead."""
    drift_ppm: float = Field(default=0.0, ge=-1e5, le=1e5)
    """Growth of the error."""

    def error_s(self, at_s: float) -> float:
        """Error at `at_s`, s; positive when the clock is ahead."""
        return self.skew_s + self.drift_ppm * 1e-6 * (at_s - self.from_s)


class SlowCpu(_Fault):
    """The daemon gets the processor only for a share of each period."""

    what: Literal["cpu_slow"]
    share: float = Field(gt=0.0, lt=1.0)
    period_s: float = Field(default=0.2, gt=0.0, le=10.0)

    def wakes_at_s(self, at_s: float) -> float:
        """Next time at which the daemon runs: `at_s` or later."""
        phase_s = (at_s - self.from_s) % self.period_s
        is_awake = phase_s < self.share * self.period_s or phase_s > self.period_s - _INSTANT_S
        return at_s if is_awake else at_s - phase_s + self.period_s


class PowerCut(_Fault):
    """The computer of the car has no power: its daemon ends at once, and starts anew at `until_s`.

    What its wires lead to keeps its power: ECU, camera, radio unit and GNSS receiver.
    """

    what: Literal["power_cut"]


class Attack(_Fault):
    """An insider injects false messages with the radio and the keys of `car`.

    `forged_brake`: warnings to its group about braking that did not happen. `ghost_car`: BSMs of a
    car `ahead_m` ahead of it that brakes hard. `replay`: all received frames again after `delay_s`.
    """

    what: Literal["forged_brake", "ghost_car", "replay"]
    every_s: float = Field(default=2.0, gt=0.0, le=60.0)
    """Interval of forged warnings, and of the ghost's braking; the ghost's BSMs have 10 Hz."""
    ahead_m: float = Field(default=25.0, gt=0.0, le=500.0)
    delay_s: float = Field(default=2.0, gt=0.0, le=60.0)
    """Delay of replayed frames."""


Fault = Annotated[
    SensorFault
    | EcuBabbles
    | SpeedScaled
    | PlateMisread
    | GnssJump
    | WrongClock
    | SlowCpu
    | PowerCut
    | Attack,
    Field(discriminator="what"),
]
