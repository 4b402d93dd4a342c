"""What every entry of a scenario's `expect` can do."""

from abc import abstractmethod
from collections.abc import Iterator

from onboard.settings import Settings
from sim_rig.run_log.run_log import RunLog


class Expected(Settings):
    """One entry."""

    @abstractmethod
    def cars_named(self) -> Iterator[str]:
        """Every car this entry speaks of."""

    def cars_telling(self) -> Iterator[str]:
        """Those of them whose traces are read: they must be equipped."""
        return self.cars_named()

    @abstractmethod
    def check(self, log: RunLog) -> Iterator[str]:
        """Yield a sentence for each thing that did not come as expected."""
