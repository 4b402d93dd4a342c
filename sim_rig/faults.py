"""What breaks on the way, and when: the faults that a scenario can order."""

from typing import Annotated, Literal

from pydantic import Field

from onboard.settings import Settings
from sim_rig.names import CarName, PlateText, Seconds


class _Fault(Settings):
    car: CarName
    """The car it happens to."""
    from_s: Seconds
    until_s: Seconds
    """When it is whole again."""

    def holds(self, car: str, at_s: float) -> bool:
        """Whether `car` has this fault at `at_s`."""
        return self.car == car and self.from_s <= at_s < self.until_s


class EcuStopped(_Fault):
    """The ECU is silent: the bus is up, nobody answers."""

    what: Literal["ecu_stopped"]


class CameraFrozen(_Fault):
    """The camera repeats its last picture."""

    what: Literal["camera_frozen"]


class CameraDark(_Fault):
    """The camera delivers black pictures."""

    what: Literal["camera_dark"]


class PlateMisread(_Fault):
    """The camera of `car` sees another text on the plate of the car `of`."""

    what: Literal["plate_misread"]
    of: CarName
    reads: PlateText
    rate: float = Field(gt=0.0, le=1.0)
    """Part of the frames in which it happens."""


Fault = Annotated[
    EcuStopped | CameraFrozen | CameraDark | PlateMisread, Field(discriminator="what")
]
