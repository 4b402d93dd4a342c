"""What `settings.yaml` may say."""

from pathlib import Path

from pydantic import Field

from onboard.settings import Settings, load_settings

SETTINGS_FILE = Path(__file__).with_name("settings.yaml")


class NetworkSettings(Settings):
    """One network's schooling."""

    pictures: int = Field(gt=0)
    """Rendered pictures to learn from."""
    validation_pictures: int = Field(gt=0)
    """Rendered pictures, of other plates, to measure and to calibrate on."""
    epochs: int = Field(gt=0)
    """Times that every picture is seen."""
    batch: int = Field(gt=0)
    """Pictures a step."""
    peak_rate: float = Field(gt=0)
    """Highest learning rate of the one-cycle schedule."""


class TrainingSettings(Settings):
    """The whole of it."""

    seed: int
    """Of everything drawn at random."""
    reader: NetworkSettings
    detector: NetworkSettings


def load_training_settings() -> TrainingSettings:
    """Read `settings.yaml`.

    Raises:
        SettingsError: it does not fit.
    """
    return load_settings(SETTINGS_FILE, TrainingSettings)
