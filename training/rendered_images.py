"""Rendered images in memory-mapped files, made once, by several processes."""

import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Renderer = Callable[[int, np.random.Generator], tuple[Array, ...]]
"""Makes arrays of the given number of rows each with a generator."""

_SHARD = 1000


@dataclass(frozen=True, slots=True)
class _Shard:
    number: int
    rows: int
    seed: int


def rendered(
    folder: Path, renderer: Renderer, count: int, seed: int, processes: int
) -> list[Array]:
    """Render arrays of `count` rows, or load them from `folder` if they exist.

    Every shard has a generator of its own, so that the images do not depend on the number of
    processes.

    Args:
        folder: for the files.
        renderer: makes the rows.
        count: rows.
        seed: of all generators.
        processes: to render with.
    """
    folder.mkdir(parents=True, exist_ok=True)
    shards = [
        _Shard(number, min(_SHARD, count - start), seed)
        for number, start in enumerate(range(0, count, _SHARD))
    ]
    first = renderer(1, np.random.default_rng(seed))
    files = [folder / f"{index}.npy" for index in range(len(first))]
    if not all(file.is_file() for file in files):
        parts = [file.with_suffix(".part.npy") for file in files]
        arrays = [
            np.lib.format.open_memmap(part, "w+", like.dtype, (count, *like.shape[1:]))
            for part, like in zip(parts, first, strict=True)
        ]
        # Spawned processes: a fork would inherit OpenCV's locks without its threads.
        fresh = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(processes, fresh, initializer=_one_thread) as pool:
            for shard, rows in pool.map(partial(_render, renderer), shards):
                start = shard.number * _SHARD
                for array, values in zip(arrays, rows, strict=True):
                    array[start : start + shard.rows] = values
        for array, part, file in zip(arrays, parts, files, strict=True):
            array.flush()
            part.rename(file)
    return [np.load(file, mmap_mode="r") for file in files]


def _one_thread() -> None:
    cv2.setNumThreads(1)


def _render(renderer: Renderer, shard: _Shard) -> tuple[_Shard, tuple[Array, ...]]:
    return shard, renderer(shard.rows, np.random.default_rng([shard.seed, shard.number]))
