"""Keeps what is known of the driver from one drive to the next, on this box's disk only."""

import os
from pathlib import Path

from onboard.access.driver_model import DriverMemory, DriverModel, Population
from onboard.errors import UserError
from onboard.settings import load_settings


def load_driver(path: Path, population: Population) -> DriverModel:
    """Remember the driver; one of the population where there is no file yet.

    Raises:
        SettingsError: the file is there and not what `save_driver` writes.
    """
    memory = load_settings(path, DriverMemory) if path.exists() else None
    return DriverModel(population, memory=memory)


def save_driver(path: Path, driver: DriverModel) -> None:
    """Write all or nothing, readable by its owner only.

    Raises:
        UserError: it cannot be written there.
    """
    new = path.with_name(path.name + ".new")
    try:
        descriptor = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            file.write(driver.memory().model_dump_json() + "\n")
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {error.strerror}") from error
