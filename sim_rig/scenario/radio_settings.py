"""Settings of the radio channel between the cars: one of three models."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from onboard.settings import Settings
from sim_rig.propagation.path_loss import DualSlope, PathLoss
from sim_rig.propagation.shadowing import Building
from sim_rig.scenario.field_types import CarName


class ReachSettings(Settings):
    """Simple channel: connectivity, delay and loss, without channel access."""

    model: Literal["reach"] = "reach"
    reach_m: float | None = Field(default=None, gt=0.0, le=10_000.0)
    """Largest distance at which two cars receive each other's frames."""
    neighbours: Mapping[CarName, tuple[CarName, ...]] | None = None
    """Instead of `reach_m`: the pairs of cars that receive each other, at any distance."""
    delay_s: float = Field(default=0.001, ge=0.0, le=10.0)
    """From the transmitting to the receiving radio unit."""
    jitter_s: float = Field(default=0.0, ge=0.0, le=10.0)
    """Added to the delay: uniform between 0 and this."""
    loss: float = Field(default=0.0, ge=0.0, le=1.0)
    """Share of the copies that are lost, independent for each receiver."""
    duplication: float = Field(default=0.0, ge=0.0, le=1.0)
    """Share of the copies that arrive twice."""
    reordering: float = Field(default=0.0, ge=0.0, le=1.0)
    """Share of the copies that are delayed by `hold_back_s`, so that later ones overtake them."""
    hold_back_s: float = Field(default=0.05, ge=0.0, le=10.0)
    """Extra delay of reordered copies."""

    @model_validator(mode="after")
    def _has_one_connectivity(self) -> Self:
        if (self.reach_m is None) == (self.neighbours is None):
            raise ValueError("exactly one of reach_m and neighbours")
        return self


class LinkSettings(Settings):
    """What the received power follows from."""

    tx_power_dbm: float = Field(default=20.0, ge=-10.0, le=40.0)
    """Transmit power at the antenna."""
    path_loss: PathLoss = DualSlope()
    """Model of the loss over the distance."""
    nakagami_m: float | None = Field(default=None, ge=0.5, le=50.0)
    """Shape of Nakagami fading, drawn for each frame and receiver: 1 is Rayleigh; null is none."""
    buildings: tuple[Building, ...] = ()
    """Ground plans of the buildings that attenuate the signal."""
    vehicles_shadow: bool = False
    """Whether cars between two antennas attenuate the signal."""
    antenna_height_m: float = Field(default=1.5, gt=0.0, le=5.0)
    """Of all antennas above the road, where vehicles shadow."""
    frequency_ghz: float = Field(default=5.86, gt=0.5, le=10.0)
    """Of the carrier, where vehicles shadow."""
    sensitivity_dbm: float = Field(default=-104.0, ge=-140.0, le=0.0)
    """Weaker signals do not count."""


class CsmaSettings(LinkSettings):
    """The 802.11p channel with carrier sensing, interference and collisions.

    Defaults are those of IEEE 802.11-2016 for 10 MHz channels outside the context of a BSS, and
    the values of docs/radio.md.
    """

    model: Literal["csma"] = "csma"
    """IEEE 802.11p."""
    data_rate_mbit_s: Literal[3, 6, 9, 12, 18, 24, 27] = 6
    """Of all frames, in a 10 MHz channel."""
    noise_figure_db: float = Field(default=7.0, ge=0.0, le=30.0)
    """Noise that the receiver adds to the thermal noise."""
    preamble_snr_db: float = Field(default=4.0, ge=-10.0, le=30.0)
    """Least SINR at which a preamble is detected."""
    preamble_dbm: float = Field(default=-95.0, ge=-120.0, le=0.0)
    """Least received power at which a preamble is detected."""
    energy_detection_dbm: float = Field(default=-85.0, ge=-120.0, le=0.0)
    """Total received power from which the channel is busy, with or without a detected preamble."""
    symbol_us: Literal[4, 8] = 8
    """OFDM symbols last 8 us in 10 MHz channels; ns-3 rounds the frame duration up to 4 us."""


class SidelinkSettings(LinkSettings):
    """C-V2X: the LTE sidelink (PC5) in mode 4, in 10 MHz.

    Defaults are those of Gonzalez-Martin et al., "Analytical Models of the Performance of C-V2X
    Mode 4 Vehicular Communications" (IEEE TVT 68-2, 2019).
    """

    model: Literal["sidelink"] = "sidelink"
    """C-V2X."""
    subchannels: int = Field(default=4, ge=1, le=10)
    """Number of subchannels in 10 MHz."""
    code_rate: float = Field(default=0.7, ge=0.5, le=0.7)
    """Of QPSK: 0.5 or 0.7; with 2 subchannels, 190 bytes fit into one at 0.5."""
    subchannel_bytes: int = Field(default=190, ge=20, le=1000)
    """That one subchannel carries in a subframe of 1 ms; a message has as many as it needs. One
    that is larger than all of them has all, as if the rate were higher at the same errors."""
    sensitivity_dbm: float = Field(default=-90.5, ge=-140.0, le=0.0)
    """Least received power at which a message is decoded."""
    noise_figure_db: float = Field(default=9.0, ge=0.0, le=30.0)
    """Noise that the receiver adds to the thermal noise."""
    shadowing_db: float = Field(default=0.0, ge=0.0, le=20.0)
    """Standard deviation of lognormal shadowing, drawn for each message and receiver."""
    event_window_ms: int = Field(default=20, ge=20, le=100)
    """In which a single message is sent; a periodic one has 100 ms."""

    @field_validator("code_rate")
    @classmethod
    def _has_published_errors(cls, code_rate: float) -> float:
        if code_rate not in {0.5, 0.7}:
            raise ValueError("must be 0.5 or 0.7, whose block error rates are published")
        return code_rate


def _model_of(value: Any) -> str:
    """Model of the given settings; `reach` if none is given."""
    if isinstance(value, Settings):
        value = value.model_dump()
    return str(value.get("model", "reach")) if isinstance(value, Mapping) else "reach"


ChannelSettings = CsmaSettings | SidelinkSettings
"""Channels with access and interference."""
AirSettings = Annotated[
    Annotated[ReachSettings, Tag("reach")]
    | Annotated[CsmaSettings, Tag("csma")]
    | Annotated[SidelinkSettings, Tag("sidelink")],
    Discriminator(_model_of),
]
