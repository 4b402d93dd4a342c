"""Where gpsd is, and how far its receiver is believed."""

from pydantic import Field

from onboard.settings import Settings


class GnssSettings(Settings):
    """One GNSS receiver."""

    host: str = Field("127.0.0.1", min_length=1)
    """Of gpsd."""
    port: int = Field(2947, ge=1, le=65535)
    """Of gpsd; 2947 is its own."""
    latency_s: float = Field(0.1, ge=0.0, le=1.0)
    """From the instant of a fix to its first byte here, at best. Typical receivers need 0.05 to
    0.1 s to compute and some to send; it is theirs to state and yours to measure."""
    range_error_m: float = Field(4.0, gt=0.0, le=100.0)
    """One standard deviation of a pseudorange (UERE) without corrections, for receivers that tell
    no accuracy but only the dilution of precision."""
    least_sigma_m: float = Field(0.5, gt=0.0, le=100.0)
    """Nothing better is believed, whatever the receiver says; lower it for RTK."""
