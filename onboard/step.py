"""Inputs and outputs of one step of a vehicle's cores (`onboard.vehicle.stack.Stack.step`)."""

from dataclasses import dataclass
from typing import ClassVar

from onboard.obd.can_frame import CanFrame
from onboard.observations import (
    BrakePedal,
    DetectionList,
    Discarded,
    HardBrake,
    Lead,
    Plate,
    Position,
    SensorImpaired,
    SensorLost,
    SensorRecovered,
    Speed,
    Steering,
    TurnSignal,
    VehicleDetection,
    YawRate,
)
from onboard.trace.trace_line import Event

Observation = (
    Speed | BrakePedal | TurnSignal | HardBrake | Plate | Lead | VehicleDetection | DetectionList
    | Position | SensorImpaired | SensorLost | SensorRecovered | Discarded
)  # fmt: skip
"""Values that the sensors' packages put out."""

HostObservation = Observation | YawRate | Steering
"""With those that only frames of the bus tell, which are inputs themselves."""


@dataclass(frozen=True, slots=True)
class ReceivedWsm:
    """A WAVE short message from the radio."""

    kind: ClassVar[str] = "wsm"
    stamp_s: float
    data: bytes


@dataclass(frozen=True, slots=True)
class SentWsm:
    """A WAVE short message for the radio."""

    kind: ClassVar[str] = "wsm"
    stamp_s: float
    user_priority: int
    """IEEE 802.1D, 0 to 7."""
    data: bytes


def send_later(_: SentWsm) -> None:
    """Send nothing yet: a step's outputs have all that is to be sent."""


@dataclass(frozen=True, slots=True)
class BrakeButton:
    """Press of the demonstration's brake button (LCCA, section 4): warn without braking."""

    kind: ClassVar[str] = "brake_button"
    stamp_s: float


@dataclass(frozen=True, slots=True)
class ProgramMessage:
    """A message that another program has the vehicle sign and send."""

    kind: ClassVar[str] = "program_message"
    stamp_s: float
    service: int
    """PSID or ITS-AID."""
    user_priority: int
    """Lower than that of the vehicle's own messages but the certificates that it is asked for."""
    data: bytes


Input = CanFrame | ReceivedWsm | BrakeButton | ProgramMessage | Observation


@dataclass(frozen=True, slots=True)
class StepOutputs:
    """Everything that one step puts out."""

    wsms: list[SentWsm]
    """For the radio, the most urgent first."""
    can_frames: list[CanFrame]
    """For the vehicle's bus."""
    events: list[Event]
    """For trace, display and journal, in order."""
    timer_at: float
    """When the next step is due without any input; `math.inf` if never."""
