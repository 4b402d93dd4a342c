"""What stands beside a number keeps to its place."""

import numpy as np
import pytest

from sim_rig.rendering.emblems import crest, emblem, mark
from sim_rig.rendering.plate_art import Outline

INK = (20, 20, 20)


def reach(outlines: tuple[Outline, ...]) -> np.ndarray:
    """Farthest from (0, 0) to the side and up or down."""
    points = [point for outline in outlines for point in outline.points_mm]
    return np.asarray(np.abs(points).max(axis=0))


@pytest.mark.parametrize("seed", range(40))
def test_an_emblem_is_as_large_as_asked_for(seed: int) -> None:
    x, y = reach(emblem(np.random.default_rng(seed), (0.0, 0.0), (20.0, 60.0), INK))

    assert 2.0 < x < 20.0  # charges and strokes may stand out a little
    assert 6.0 < y < 45.0


@pytest.mark.parametrize("seed", range(40))
def test_a_mark_stays_in_its_row(seed: int) -> None:
    x, y = reach(mark(np.random.default_rng(seed), INK))

    assert x < 0.35
    assert y < 0.6


def test_an_emblem_stands_where_it_is_put() -> None:
    here, there = (crest(np.random.default_rng(7), at, (20, 30), INK) for at in ((0, 0), (50, 10)))

    for one, other in zip(here, there, strict=True):
        assert np.allclose(np.add(one.points_mm, (50, 10)), other.points_mm)
        assert one.bgr == other.bgr
