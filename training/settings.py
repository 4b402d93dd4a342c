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
    steps: int = Field(gt=0)
    """Batches to learn from; the pictures are gone through as often as that takes."""
    batch: int = Field(gt=0)
    """Pictures a step."""
    peak_rate: float = Field(gt=0)
    """Learning rate after the warm-up and before the decay (`training/schooling.py`)."""
    begins_with: str | None = None
    """Exported network in this folder that the schooling goes on from; none: from nothing."""


class TrainingSettings(Settings):
    """The whole of it."""

    seed: int
    """Of everything drawn at random."""
    reader: NetworkSettings
    detector: NetworkSettings


def load_training_settings(file: Path) -> TrainingSettings:
    """Read `settings.yaml`, or another one.

    Raises:
        SettingsError: it does not fit.
    """
    return load_settings(file, TrainingSettings)
