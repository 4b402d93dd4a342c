"""States of many cars, or pieces of evidence about them, as arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class StateArrays:
    """N states of cars, or pieces of evidence about them, each at its own time."""

    stamps_ms: Array
    """(N)"""
    states: Array
    """(4, N); the speed of a mere position is 0 and means nothing."""
    covariances: Array
    """(4, 4, N)"""
    has_speed: Array
    """(N), 1.0 or 0.0."""

    def __len__(self) -> int:
        return len(self.stamps_ms)

    def __getitem__(self, rows: Any) -> Self:
        """Some of them, by whatever indexes an axis; `[:, None]` makes them a column."""
        index = rows if isinstance(rows, tuple) else (rows,)
        every = slice(None)
        return type(self)(
            self.stamps_ms[index],
            self.states[(every, *index)],
            self.covariances[(every, every, *index)],
            self.has_speed[index],
        )

    def places_m(self, at_ms: int) -> Array:
        """Where they are at `at_ms`: (2, N)."""
        places: Array = self.states[:2] + (at_ms - self.stamps_ms) / 1000 * self.states[2:]
        return places

    def with_any_speed(self, sigma_m_s: float) -> Self:
        """The same as whole states: a mere position says of the speed 0 +- `sigma_m_s`."""
        covariances = self.covariances.copy()
        covariances[[2, 3], [2, 3]] += (1.0 - self.has_speed) * sigma_m_s**2
        return type(self)(self.stamps_ms, self.states, covariances, np.ones(len(self)))

    def mapped(self, turns: Array, shifts: Array) -> Self:
        """The same in other frames, (N, 2, 2) and (N, 2) (`LocalFrame.mapping_from`)."""
        both = np.zeros((len(self), 4, 4))
        both[:, :2, :2] = both[:, 2:, 2:] = turns
        states = (both @ self.states.T[:, :, None])[:, :, 0].T
        states[:2] += shifts.T
        covariances = both @ self.covariances.transpose(2, 0, 1) @ both.transpose(0, 2, 1)
        return type(self)(self.stamps_ms, states, covariances.transpose(1, 2, 0), self.has_speed)

    @classmethod
    def together(cls, some: Sequence[Self]) -> Self:
        """All of `some`, one after the other."""
        return cls(
            np.concatenate([each.stamps_ms for each in some]),
            np.concatenate([each.states for each in some], axis=1),
            np.concatenate([each.covariances for each in some], axis=2),
            np.concatenate([each.has_speed for each in some]),
        )


def map_state(state: Array, covariance: Array, turn: Array, shift: Array) -> tuple[Array, Array]:
    """State (4) and covariance (4, 4) in another frame (`LocalFrame.mapping_from`)."""
    both = turn_of_state(turn)
    mapped = both @ state
    mapped[:2] += shift
    return mapped, both @ covariance @ both.T


def turn_of_state(turn: Array) -> Array:
    """The turn (4, 4) of position and velocity."""
    both = np.zeros((4, 4))
    both[:2, :2] = both[2:, 2:] = turn
    return both
