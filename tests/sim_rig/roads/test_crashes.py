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
    one, other = (
        (
            (float(place[0]), float(place[1])),
            (float(length), float(width)),
            float(np.degrees(heading)),
        )
        for place, length, width, heading in zip(
            cars.middle_m, cars.length_m, cars.width_m, cars.heading_rad, strict=True
        )
    )
    kind, _ = cv2.rotatedRectangleIntersection(one, other)
    return kind != cv2.INTERSECT_NONE


@pytest.mark.long
@pytest.mark.parametrize("most_turned", [0.3, 3.1])
@pytest.mark.parametrize("seed", range(30))
def test_the_first_touch_is_where_small_steps_find_it(seed: int, most_turned: float) -> None:
    rng = np.random.default_rng(seed)
    sizes = np.stack([rng.uniform(3.5, 6.0, 2), rng.uniform(1.6, 2.2, 2)], axis=1)
    places = np.array([[0.0, 0.0], rng.uniform(-7.0, 7.0, 2)])
    headings = rng.uniform(-np.pi, np.pi, 2)
    moves, turns = rng.uniform(-4.0, 4.0, (2, 2)), rng.uniform(-most_turned, most_turned, 2)
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


@pytest.mark.parametrize("left_m", [0.1, 0.02, 0.001, 1e-4, -1e-4, -0.02])
@pytest.mark.parametrize("turned", [3.0, -3.0, 1.5])
def test_a_car_that_turns_about_itself_touches_what_is_within_its_corners(
    left_m: float, turned: float
) -> None:
    """Its corners draw a circle, and a wall beside that is touched or not by how near it is."""
    sizes = np.array([[4.0, 2.0], [60.0, 2.0]])
    corner_m, to_corner = np.hypot(2.0, 1.0), np.arctan2(1.0, 2.0)
    places = np.array([[0.0, 0.0], [0.0, corner_m + left_m + 1.0]])
    before = two_cars(0.0, places, np.zeros(2), sizes)
    after = two_cars(1.0, places, np.array([turned, 0.0]), sizes)

    crash = first_crash(before, after)

    if left_m > 0.0:
        assert crash is None
    else:
        # The front left corner is as high as the wall at this angle; turning right, the rear one.
        meets = np.arcsin((corner_m + left_m) / corner_m) - to_corner
        assert crash is not None
        assert crash.at_s == pytest.approx(meets / abs(turned), abs=5e-5)


def test_cars_that_pass_a_hand_beside_each_other_do_not_touch() -> None:
    """3 cm for 9 m of a step of 16 m, which is longer than any number of small jumps."""
    sizes = np.array([[4.5, 1.8], [4.5, 1.8]])
    places, moves = np.array([[-4.0, 0.0], [4.0, 1.83]]), np.array([[8.0, 0.0], [-8.0, 0.0]])
    headings = np.array([0.0, np.pi])
    before, after = (two_cars(at, places + at * moves, headings, sizes) for at in (0.0, 1.0))

    assert first_crash(before, after) is None


def test_pairs_that_do_not_count_pass_through_each_other() -> None:
    sizes = np.array([[4.0, 2.0], [4.0, 2.0]])
    cars = two_cars(0.0, np.zeros((2, 2)), np.zeros(2), sizes)

    assert boxes_overlap(cars) == [(0, 1)]
    assert first_crash(cars, cars) is not None
    assert first_crash(cars, cars, lambda *_: False) is None
