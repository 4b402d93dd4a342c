"""Training scenes of the vehicle detector, and their augmentation."""

import cv2
import numpy as np
import pytest

from training.vehicle_scenes import (
    BOTTOM,
    END_LEFT,
    END_RIGHT,
    LEFT,
    MAX_VEHICLES,
    RIGHT,
    SCENE_SIZE,
    TOP,
    render_vehicle_scenes,
    viewed,
)


@pytest.mark.long
def test_the_same_seed_gives_the_same_scenes() -> None:
    one, other = (render_vehicle_scenes(2, np.random.default_rng(4)) for _ in range(2))
    assert np.array_equal(one[0], other[0])
    assert np.array_equal(one[1], other[1], equal_nan=True)


@pytest.mark.parametrize("seed", range(8))
def test_boxes_move_with_what_is_seen(seed: int) -> None:
    """A white board on black, whose right half is the vehicle's rear."""
    scenes = np.zeros((1, SCENE_SIZE[1], SCENE_SIZE[0], 3), np.uint8)
    scenes[0, 110:130, 180:230] = 255
    vehicles = np.full((1, MAX_VEHICLES, 8), np.nan, np.float32)
    vehicles[0, 0] = (180, 110, 230, 130, 205, 230, 0, 1)
    views, places = viewed(scenes, vehicles, np.random.default_rng(seed))
    left, top, wide, high = cv2.boundingRect((views[0, :, :, 0] > 127).astype(np.uint8))
    seen = places[0, 0]
    assert seen[[LEFT, TOP]] == pytest.approx([left, top], abs=1.0)
    assert seen[[RIGHT, BOTTOM]] == pytest.approx([left + wide, top + high], abs=1.0)
    half = (seen[RIGHT] - seen[LEFT]) / 2
    assert seen[END_RIGHT] - seen[END_LEFT] == pytest.approx(half, abs=0.1)
    assert np.isnan(places[0, 1:]).all()


def test_looks_at_one_scene_differ_in_exposure_and_colour() -> None:
    scenes = np.full((12, SCENE_SIZE[1], SCENE_SIZE[0], 3), 100, np.uint8)
    vehicles = np.full((12, MAX_VEHICLES, 8), np.nan, np.float32)
    views, _ = viewed(scenes, vehicles, np.random.default_rng(1))
    levels = views.mean(axis=(1, 2))
    assert np.ptp(levels.mean(axis=1)) > 40.0
    assert np.ptp(levels, axis=1).max() > 10.0
