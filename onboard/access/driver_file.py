"""The file that keeps the driver model from one drive to the next, on the local disk only."""

import os
from pathlib import Path

from onboard.access.driver_model import DriverMemory, DriverModel, Population
from onboard.errors import UserError
from onboard.settings import load_settings


class DriverFile:
    """The driver model of one drive, and its file, if there is one.

    A file that cannot be read is left as it is: the drive begins with the population's model, and
    `save` says why nothing is kept.
    """

    def __init__(self, path: Path | None, population: Population) -> None:
        """Read the file."""
        self._path = path
        self._unreadable: UserError | None = None
        self.driver = DriverModel(population)
        try:
            if path is not None:
                self.driver = load_driver(path, population)
        except UserError as error:
            self._unreadable = error

    def save(self) -> None:
        """Write the model to the file.

        Raises:
            UserError: the file cannot be written, or could not be read.
        """
        if self._unreadable is not None:
            raise self._unreadable
        if self._path is not None:
            save_driver(self._path, self.driver)


def load_driver(path: Path, population: Population) -> DriverModel:
    """Load the driver model; without a file, return that of the population.

    Raises:
        SettingsError: the file exists and is not in the format of `save_driver`.
    """
    memory = load_settings(path, DriverMemory) if os.path.lexists(path) else None
    return DriverModel(population, memory=memory)


def save_driver(path: Path, driver: DriverModel) -> None:
    """Write the driver model atomically, readable by its owner only.

    Raises:
        UserError: the file cannot be written.
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
