"""Recorded motion: a trace from a file, or the output of another source.

All trajectories have the same sampling interval, so that interpolation is one vector operation.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from typing_extensions import override

from onboard.errors import UserError
from sim_rig.roads.cars import Array, Cars, Traffic

STEP_S = 0.1
"""Sampling interval."""
_LEAST_STEP_M = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Motion of one car from its first to its last step: K samples at `STEP_S`."""

    name: str
    first: int
    """Number of the step of the first sample."""
    middle_m: Array
    """(K, 2)"""
    heading_rad: Array
    """(K,), unwrapped."""
    speed_m_s: Array
    """(K)"""
    length_m: float
    width_m: float

    def __len__(self) -> int:
        return len(self.heading_rad)

    @property
    def last(self) -> int:
        """Number of the step of the last sample."""
        return self.first + len(self) - 1

    def ways_m(self) -> Array:
        """Return the way from the first sample to each, (K,): it grows a little while it stands.

        So each place on the way has one time.
        """
        moved_m = np.hypot(*np.diff(self.middle_m, axis=0).T)
        return np.concatenate([[0.0], np.cumsum(np.maximum(moved_m, _LEAST_STEP_M))])


class RecordedTraffic(Traffic):
    """Interpolates many trajectories at any times in any order."""

    def __init__(self, drives: Iterable[Trajectory]) -> None:
        self.drives = tuple(sorted(drives, key=lambda drive: drive.first))
        self._first = np.array([drive.first for drive in self.drives])
        self._last = np.array([drive.last for drive in self.drives])
        lengths = [len(drive) for drive in self.drives]
        self._begin = np.cumsum([0, *lengths[:-1]])
        self._middle_m = np.concatenate([np.zeros((0, 2)), *(d.middle_m for d in self.drives)])
        self._heading_rad = np.concatenate([[], *(d.heading_rad for d in self.drives)])
        self._speed_m_s = np.concatenate([[], *(d.speed_m_s for d in self.drives)])
        self._length_m = np.array([drive.length_m for drive in self.drives])
        self._width_m = np.array([drive.width_m for drive in self.drives])

    @property
    def end_s(self) -> float:
        """Time of the last sample, s."""
        return float(self._last.max(initial=0)) * STEP_S

    def drive(self, name: str) -> Trajectory:
        """Return one trajectory.

        Raises:
            UserError: none has this name.
        """
        found = next((drive for drive in self.drives if drive.name == name), None)
        if found is None:
            names = ", ".join(drive.name for drive in self.drives)
            raise UserError(f"no car {name!r} in the recording; cars: {names}")
        return found

    def there(self, at_s: float) -> list[int]:
        """Indices of the trajectories that cover `at_s`."""
        step = at_s / STEP_S
        on: list[int] = np.flatnonzero((self._first <= step) & (step <= self._last)).tolist()
        return on

    @override
    def cars_at(self, at_s: float) -> Cars:
        """All cars at `at_s`, linear between the samples."""
        on = np.array(self.there(at_s), dtype=np.intp)
        steps = at_s / STEP_S - self._first[on]
        whole = np.minimum(
            steps.astype(np.intp), np.maximum(self._last[on] - self._first[on] - 1, 0)
        )
        part, low = steps - whole, self._begin[on] + whole
        high = np.minimum(low + 1, self._begin[on] + self._last[on] - self._first[on])

        def between(samples: Array) -> Array:
            share = part if samples.ndim == 1 else part[:, None]
            mixed: Array = samples[low] * (1.0 - share) + samples[high] * share
            return mixed

        return Cars(
            at_s,
            tuple(self.drives[i].name for i in on),
            between(self._middle_m),
            between(self._heading_rad),
            between(self._speed_m_s),
            (self._speed_m_s[high] - self._speed_m_s[low]) / STEP_S,
            self._length_m[on],
            self._width_m[on],
        )


def record(traffic: Traffic, seconds: float, begin_s: float = 0.0) -> RecordedTraffic:
    """Record a source.

    Args:
        traffic: the source.
        seconds: duration of the recording.
        begin_s: start of the recording, which becomes 0.
    """
    samples: dict[str, list[tuple[float, ...]]] = {}
    first: dict[str, int] = {}
    sizes: dict[str, tuple[float, float]] = {}
    for step in range(round(seconds / STEP_S) + 1):
        cars = traffic.cars_at(begin_s + step * STEP_S)
        numbers = np.column_stack([cars.middle_m, cars.heading_rad, cars.speed_m_s]).tolist()
        for i, name in enumerate(cars.names):
            samples.setdefault(name, []).append(tuple(numbers[i]))
            first.setdefault(name, step)
            sizes[name] = float(cars.length_m[i]), float(cars.width_m[i])
    drives = []
    for name, rows in samples.items():
        x, y, heading, speed = np.array(rows).T
        middle = np.stack([x, y], axis=1)
        drives.append(
            Trajectory(name, first[name], middle, np.unwrap(heading), speed, *sizes[name])
        )
    return RecordedTraffic(drives)
