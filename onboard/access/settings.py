"""Settings of driver-based channel access."""

from pathlib import Path

from onboard.settings import Settings


class AccessSettings(Settings):
    """Driver-based channel access."""

    enabled: bool = False
    """If false, reactions are not observed and BSMs are scheduled by SAE J2945/1 alone."""
    driver_file: Path | None = None
    """File that keeps the driver model from one drive to the next. It never leaves the computer;
    deleting it erases the model. `None` keeps nothing."""
