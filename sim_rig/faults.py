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


class SensorFault(_Fault):
    """A sensor fails as a whole."""

    what: Literal["ecu_stopped", "camera_frozen", "camera_dark", "gnss_silent", "radio_mute"]
    """The ECU is silent, nobody answers on the bus; the camera repeats its last picture; the
    camera delivers black pictures; the receiver says nothing; the radio hears and is not heard."""


class PlateMisread(_Fault):
    """The camera of `car` sees another text on the plate of the car `of`."""

    what: Literal["plate_misread"]
    of: CarName
    reads: PlateText
    rate: float = Field(gt=0.0, le=1.0)
    """Part of the frames in which it happens."""


Fault = Annotated[SensorFault | PlateMisread, Field(discriminator="what")]
