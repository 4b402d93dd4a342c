"""Base class of the entries of a scenario's `expect`."""

from abc import abstractmethod
from collections.abc import Iterator

from onboard.settings import Settings
from sim_rig.run_log.run_log import RunLog


class Expected(Settings):
    """One entry of `expect`."""

    @abstractmethod
    def cars_used(self) -> Iterator[str]:
        """Names of all cars that this entry refers to."""

    def cars_traced(self) -> Iterator[str]:
        """Names of the cars whose traces this entry reads; these must be equipped."""
        return self.cars_used()

    def cars_judged(self) -> Iterator[str]:
        """Names of the cars whose own traces decide; of others only messages to those count."""
        return self.cars_traced()

    @property
    def needs_messages_only(self) -> bool:
        """Whether the messages that its cars sent are all that this entry reads of their traces."""
        return False

    @abstractmethod
    def check(self, log: RunLog) -> Iterator[str]:
        """Yield one sentence for each deviation from the expectation."""
