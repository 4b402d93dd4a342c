"""What the air between the cars is like: either of two models."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from onboard.settings import Settings
from sim_rig.propagation.path_loss import DualSlope, PathLoss
from sim_rig.propagation.shadowing import Building
from sim_rig.scenario.field_types import CarName


class ReachSettings(Settings):
    """The simple air: who hears whom, when, and how often not. Nobody waits for anybody."""

    model: Literal["reach"] = "reach"
    reach_m: float | None = Field(default=None, gt=0.0, le=10_000.0)
    """Up to this distance between two cars they hear each other."""
    neighbours: Mapping[CarName, tuple[CarName, ...]] | None = None
    """In the place of `reach_m`: who is heard by whom, both ways, wherever they are."""
    delay_s: float = Field(default=0.001, ge=0.0, le=10.0)
    """From unit to unit."""
    jitter_s: float = Field(default=0.0, ge=0.0, le=10.0)
    """Added to the delay, uniform from 0 up to this."""
    loss: float = Field(default=0.0, ge=0.0, le=1.0)
    """Part of the copies that do not arrive, each receiver for itself."""
    duplication: float = Field(default=0.0, ge=0.0, le=1.0)
    """Part of the copies that arrive twice."""
    reordering: float = Field(default=0.0, ge=0.0, le=1.0)
    """Part of the copies that are held back, so that later ones overtake them."""
    hold_back_s: float = Field(default=0.05, ge=0.0, le=10.0)
    """For how long."""

    @model_validator(mode="after")
    def _knows_who_hears_whom(self) -> Self:
        if (self.reach_m is None) == (self.neighbours is None):
            raise ValueError("exactly one of reach_m and neighbours")
        return self


class CsmaSettings(Settings):
    """The 802.11p channel: cars listen before they talk, and collide when that does not help.

    Defaults are IEEE 802.11-2016 for 10 MHz channels outside the context of a BSS, and the sizes
    of docs/radio.md.
    """

    model: Literal["csma"] = "csma"
    data_rate_mbit_s: Literal[3, 6, 9, 12, 18, 24, 27] = 6
    tx_power_dbm: float = Field(default=20.0, ge=-10.0, le=40.0)
    path_loss: PathLoss = DualSlope()
    nakagami_m: float | None = Field(default=None, ge=0.5, le=50.0)
    """Shape of Nakagami fading, drawn for each frame and receiver: 1 is Rayleigh; null is none."""
    buildings: tuple[Building, ...] = ()
    vehicles_shadow: bool = False
    """Whether cars between two cars weaken what they hear of each other."""
    antenna_height_m: float = Field(default=1.5, gt=0.0, le=5.0)
    frequency_ghz: float = Field(default=5.86, gt=0.5, le=10.0)
    noise_figure_db: float = Field(default=7.0, ge=0.0, le=30.0)
    preamble_snr_db: float = Field(default=4.0, ge=-10.0, le=30.0)
    """Weaker against noise and interference, the beginning of a frame is not noticed."""
    preamble_dbm: float = Field(default=-95.0, ge=-120.0, le=0.0)
    """Nor below this power."""
    sensitivity_dbm: float = Field(default=-104.0, ge=-140.0, le=0.0)
    """Weaker, a signal does not even add to the interference."""
    energy_detection_dbm: float = Field(default=-85.0, ge=-120.0, le=0.0)
    """From this power of all signals together the channel is busy, noticed frame or not."""
    symbol_us: Literal[4, 8] = 8
    """OFDM symbols are 8 us long in 10 MHz; ns-3 rounds a frame up to 4 us."""


def _model_of(value: Any) -> str:
    """`reach` needs not be named."""
    if isinstance(value, Settings):
        value = value.model_dump()
    return str(value.get("model", "reach")) if isinstance(value, Mapping) else "reach"


AirSettings = Annotated[
    Annotated[ReachSettings, Tag("reach")] | Annotated[CsmaSettings, Tag("csma")],
    Discriminator(_model_of),
]
