"""Settings of the training runs (`settings.yaml`)."""

from pathlib import Path

import numpy as np
from pydantic import Field

from onboard.settings import Settings, load_settings

SETTINGS_FILE = Path(__file__).with_name("settings.yaml")


class NetworkTrainingSettings(Settings):
    """Settings of one network's training run."""

    seed: int
    """Seed of all random numbers."""
    images: int = Field(gt=0)
    """Rendered images for training."""
    validation_images: int = Field(gt=0)
    """Rendered images, of other plates, for validation and calibration."""
    rates: tuple[tuple[int, float], ...] = Field(min_length=2)
    """Learning rates at some steps, linear in between; the run ends at the last one. The images are
    repeated as often as that takes."""
    batch: int = Field(gt=0)
    """Images a step."""
    initial_network: str | None = None
    """Exported network in this folder from which the run starts; `None`: random weights."""

    @property
    def steps(self) -> int:
        """Number of steps."""
        return self.rates[-1][0]

    def rate_at(self, step: int) -> float:
        """Learning rate of a step."""
        steps, rates = zip(*self.rates, strict=True)
        return float(np.interp(step, steps, rates))


class ReaderTrainingSettings(NetworkTrainingSettings):
    """Settings of the reader's training run."""

    initial_share: float = Field(0.0, ge=0.0, lt=1.0)
    """Weight of the initial network in the average with the trained one."""
    bfloat16: bool = True
    """Whether to train in bfloat16: faster where the processor has it, and many times slower where
    it has not."""
    temperature: float | None = Field(None, gt=0.0)
    """Divisor of the logits; `None`: the one that fits the validation images
    (docs/design/plates.md)."""


class TrainingSettings(Settings):
    """Settings of the training runs."""

    reader: ReaderTrainingSettings
    detector: NetworkTrainingSettings
    vehicles: NetworkTrainingSettings


def load_training_settings(file: Path) -> TrainingSettings:
    """Read a settings file.

    Raises:
        SettingsError: it is invalid.
    """
    return load_settings(file, TrainingSettings)
