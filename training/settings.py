"""What `settings.yaml` may say."""

from pathlib import Path

import numpy as np
from pydantic import Field

from onboard.settings import Settings, load_settings

SETTINGS_FILE = Path(__file__).with_name("settings.yaml")


class NetworkSettings(Settings):
    """One network's schooling."""

    seed: int
    """Of everything drawn at random."""
    images: int = Field(gt=0)
    """Rendered pictures to learn from."""
    validation_images: int = Field(gt=0)
    """Rendered pictures, of other plates, to measure and to calibrate on."""
    rates: tuple[tuple[int, float], ...] = Field(min_length=2)
    """Learning rates at some steps, linear in between; the schooling ends at the last of them. The
    pictures are gone through as often as that takes."""
    batch: int = Field(gt=0)
    """ImageSequence a step."""
    initial_network: str | None = None
    """Exported network in this folder that the schooling goes on from; none: from nothing."""

    @property
    def steps(self) -> int:
        """Batches to learn from."""
        return self.rates[-1][0]

    def rate_at(self, step: int) -> float:
        """Learning rate of a step."""
        steps, rates = zip(*self.rates, strict=True)
        return float(np.interp(step, steps, rates))


class ReaderSettings(NetworkSettings):
    """The reader's."""

    initial_share: float = Field(0.0, ge=0.0, lt=1.0)
    """Share of what it began with in the weights that it ends with."""
    temperature: float | None = Field(None, gt=0.0)
    """What the logits are divided by; none: what fits the validation pictures (0213)."""


class TrainingSettings(Settings):
    """The whole of it."""

    reader: ReaderSettings
    detector: NetworkSettings


def load_training_settings(file: Path) -> TrainingSettings:
    """Read `settings.yaml`, or another one.

    Raises:
        SettingsError: it does not fit.
    """
    return load_settings(file, TrainingSettings)
