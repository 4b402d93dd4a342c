"""Benchmarks of speed, memory and accuracy, one JSON object a line: `python -m bench [NAME ...]`.

A benchmark is a module of this package with a function `measure() -> Iterator[Figure]`. Every
figure has a reference measured in the same run, and their ratio, since the machine is shared and
noisy.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Figure:
    """One measured figure."""

    name: str
    value: float
    unit: str
    n: int
    """Number of measurements; `value` is their median unless the name says otherwise."""
    reference: str
    """What the value is compared with."""
    reference_value: float
    """Value of the reference in the same unit."""

    @property
    def ratio(self) -> float:
        """`value` divided by `reference_value`."""
        return self.value / self.reference_value
