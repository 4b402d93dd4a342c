"""Speed and memory, one JSON object a line: `python -m bench [NAME ...]`.

A benchmark is a module here with a function `measure() -> Iterator[Figure]`. Every figure stands
beside a reference measured in the same run, as a ratio, since the machine is shared and noisy.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Figure:
    """One measured figure."""

    name: str
    value: float
    unit: str
    n: int
    """How many times it was measured; `value` is the median unless the name says otherwise."""
    reference: str
    """What it was run beside."""
    reference_value: float
    """In the same unit."""

    @property
    def ratio(self) -> float:
        """`value` by `reference_value`."""
        return self.value / self.reference_value
