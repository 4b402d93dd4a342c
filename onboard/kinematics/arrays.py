"""States of many vehicles as arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class StateArrays:
    """N states of vehicles, or pieces of evidence about them, each at its own time.

    The arrays are not edited in place: others may share them.
    """

    stamps_ms: Array
    """(N)"""
    states: Array
    """(4, N); the speed of a mere position is 0 and without meaning."""
    covariances: Array
    """(4, 4, N)"""
    has_speed: Array
    """(N), 1.0 for a whole state, 0.0 for a mere position."""

    def __len__(self) -> int:
        return len(self.stamps_ms)

    def __getitem__(self, rows: Any) -> Self:
        """Return those that numpy's indexing selects; `[:, None]` makes them a column."""
        index = rows if isinstance(rows, tuple) else (rows,)
        every = slice(None)
        return type(self)(
            self.stamps_ms[index],
            self.states[(every, *index)],
            self.covariances[(every, every, *index)],
            self.has_speed[index],
        )

    def positions_m(self, at_ms: int) -> Array:
        """Return the positions (2, N) at `at_ms`, at constant velocity."""
        positions: Array = self.states[:2] + (at_ms - self.stamps_ms) / 1000 * self.states[2:]
        return positions

    def with_unknown_speed(self, sigma_m_s: float) -> Self:
        """Return whole states; a mere position has a speed of 0 +- `sigma_m_s`."""
        covariances = self.covariances.copy()
        covariances[[2, 3], [2, 3]] += (1.0 - self.has_speed) * sigma_m_s**2
        return type(self)(self.stamps_ms, self.states, covariances, np.ones(len(self)))

    def with_velocities(self, velocities: Mapping[int, tuple[Array, Array]]) -> Self:
        """Return whole states where a velocity (2) and its covariance (2, 2) are given by index."""
        if not velocities:
            return self
        states, covariances = self.states.copy(), self.covariances.copy()
        has_speed = self.has_speed.copy()
        for at, (velocity, covariance) in velocities.items():
            states[2:, at], covariances[2:, 2:, at], has_speed[at] = velocity, covariance, 1.0
        return type(self)(self.stamps_ms, states, covariances, has_speed)

    def with_covariances_scaled(self, factors: Array) -> Self:
        """Return the states with each covariance multiplied by its factor (N)."""
        covariances = self.covariances.copy(order="K")
        covariances *= factors
        return type(self)(self.stamps_ms, self.states, covariances, self.has_speed)

    def mapped(self, turns: Array, shifts: Array) -> Self:
        """Return the states in other frames, (N, 2, 2) and (N, 2) (`LocalFrame.mapping_from`)."""
        both = np.zeros((len(self), 4, 4))
        both[:, :2, :2] = both[:, 2:, 2:] = turns
        states = (both @ self.states.T[:, :, None])[:, :, 0].T
        states[:2] += shifts.T
        covariances = both @ self.covariances.transpose(2, 0, 1) @ both.transpose(0, 2, 1)
        return type(self)(self.stamps_ms, states, covariances.transpose(1, 2, 0), self.has_speed)

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return all of `parts`, one after the other."""
        return cls(
            np.concatenate([each.stamps_ms for each in parts]),
            np.concatenate([each.states for each in parts], axis=1),
            np.concatenate([each.covariances for each in parts], axis=2),
            np.concatenate([each.has_speed for each in parts]),
        )


def map_state(state: Array, covariance: Array, turn: Array, shift: Array) -> tuple[Array, Array]:
    """Map one state into another frame (`LocalFrame.mapping_from`).

    Args:
        state: (4).
        covariance: (4, 4).
        turn: (2, 2).
        shift: (2) m.

    Returns:
        the mapped state and covariance.
    """
    both = np.zeros((4, 4))
    both[:2, :2] = both[2:, 2:] = turn
    mapped = both @ state
    mapped[:2] += shift
    return mapped, both @ covariance @ both.T
