"""Settings of gpsd and of its receiver."""

from pydantic import Field

from onboard.settings import Settings


class GnssSettings(Settings):
    """One GNSS receiver, by gpsd."""

    host: str = Field("127.0.0.1", min_length=1)
    """Host of gpsd."""
    port: int = Field(2947, ge=1, le=65535)
    """Port of gpsd."""
    latency_s: float = Field(0.1, ge=0.0, le=1.0)
    """Least time from a fix to its first byte. Typical receivers compute for 0.05 to 0.1 s and then
    send; see the receiver's data sheet, or measure it."""
    least_sigma_m: float = Field(0.5, gt=0.0, le=100.0)
    """Least standard deviation of a position, whatever the receiver reports; lower it for RTK."""
