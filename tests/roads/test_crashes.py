"""The first touch of two boxes, beside OpenCV's polygon intersection in many small steps."""

import cv2
import numpy as np
import pytest

from sim_rig.roads.cars import Cars
from sim_rig.roads.crashes import boxes_overlap, first_crash

STEPS = 2000


def two_cars(at_s: float, places: np.ndarray, headings: np.ndarray, sizes: np.ndarray) -> Cars:
    """Arguments (2, 2), (2), and (2, 2): length and width."""
    still = np.zeros(2)
    return Cars(at_s, ("a", "b"), places, headings, still, still, sizes[:, 0], sizes[:, 1])


def overlap(cars: Cars) -> bool:
    """By OpenCV, in a scale in which its single precision does not matter."""
    boxes = [
        (tuple(map(float, place)), (float(length), float(width)), float(np.degrees(heading)))
        for place, length, width, heading in zip(
            cars.middle_m, cars.length_m, cars.width_m, cars.heading_rad, strict=True
        )
    ]
    kind, _ = cv2.rotatedRectangleIntersection(*boxes)
    return kind != cv2.INTERSECT_NONE


@pytest.mark.parametrize("seed", range(40))
def test_the_first_touch_is_where_small_steps_find_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sizes = np.stack([rng.uniform(3.5, 6.0, 2), rng.uniform(1.6, 2.2, 2)], axis=1)
    places = np.array([[0.0, 0.0], rng.uniform(-7.0, 7.0, 2)])
    headings = rng.uniform(-np.pi, np.pi, 2)
    moves, turns = rng.uniform(-4.0, 4.0, (2, 2)), rng.uniform(-0.3, 0.3, 2)
    before = two_cars(5.0, places, headings, sizes)
    after = two_cars(6.0, places + moves, headings + turns, sizes)

    crash = first_crash(before, after)

    shares = np.linspace(0.0, 1.0, STEPS + 1)
    touching = [
        overlap(two_cars(0.0, places + share * moves, headings + share * turns, sizes))
        for share in shares
    ]
    if crash is None:
        assert not any(touching)
    else:
        assert any(touching)
        sampled = shares[touching.index(True)]
        assert crash.at_s - 5.0 == pytest.approx(sampled, abs=1.5 / STEPS + 1e-3)


def test_a_touch_that_begins_and_ends_between_two_steps_is_found() -> None:
    sizes = np.array([[4.0, 2.0], [4.0, 2.0]])
    before = two_cars(0.0, np.array([[-9.0, 0.0], [0.0, 3.9]]), np.array([0.0, np.pi / 2]), sizes)
    after = two_cars(0.1, np.array([[9.0, 0.0], [0.0, 3.9]]), np.array([0.0, np.pi / 2]), sizes)
    missed = two_cars(0.1, np.array([[9.0, 0.0], [0.0, 3.9]]), np.array([0.0, np.pi / 2]), sizes)
    higher = np.array([[0.0, 0.0], [0.0, 0.3]])

    assert boxes_overlap(before) == boxes_overlap(after) == []
    assert first_crash(before, missed) is None
    low = (
        two_cars(0.0, before.middle_m - higher * 4, before.heading_rad, sizes),
        two_cars(0.1, after.middle_m - higher * 4, after.heading_rad, sizes),
    )
    crash = first_crash(*low)
    assert crash is not None
    # Bumper to side: 9 m less half a length less half a width of 18 m in 0.1 s.
    assert crash.at_s == pytest.approx(0.1 * (9.0 - 2.0 - 1.0) / 18.0, abs=1e-6)


def test_pairs_that_do_not_count_pass_through_each_other() -> None:
    sizes = np.array([[4.0, 2.0], [4.0, 2.0]])
    cars = two_cars(0.0, np.zeros((2, 2)), np.zeros(2), sizes)

    assert boxes_overlap(cars) == [(0, 1)]
    assert first_crash(cars, cars) is not None
    assert first_crash(cars, cars, lambda *_: False) is None
