"""Settings of `make train`. A training run itself needs PyTorch: `make train-trial`."""

from pathlib import Path

import pytest

from onboard.settings import SettingsError
from training.settings import SETTINGS_FILE, load_training_settings

FILES = SETTINGS_FILE, SETTINGS_FILE.with_name("trial.yaml")


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_learning_rates_rise_from_near_zero_and_fall_to_zero(file: Path) -> None:
    settings = load_training_settings(file)

    for network in (settings.reader, settings.detector, settings.vehicles):
        rates = [network.rate_at(step) for step in range(network.steps)]
        assert all(0 < rate < 0.01 for rate in rates)
        assert rates[-1] < 0.1 * max(rates)
        assert network.rate_at(network.steps) == 0


@pytest.mark.parametrize("network", ["reader", "detector"])
def test_the_initial_network_of_a_training_run_exists(network: str) -> None:
    initial_network = getattr(load_training_settings(SETTINGS_FILE), network).initial_network

    assert initial_network is not None
    assert SETTINGS_FILE.with_name(initial_network).is_file()


def test_an_unknown_setting_is_an_error(tmp_path: Path) -> None:
    file = tmp_path / "settings.yaml"
    file.write_text(SETTINGS_FILE.read_text(encoding="utf-8") + "speed: 3\n", encoding="utf-8")

    with pytest.raises(SettingsError, match="speed"):
        load_training_settings(file)
