"""The offset of a box's clock is bounded by frames of both directions."""

import numpy as np
import pytest

from sim_rig.run_log.clock_offset import MAX_RATE_ERROR, ClockError, clock_offset

OFFSET_S = 1234.5
"""Rig time minus box time."""


def frames(
    rng: np.random.Generator, rate_error: float = 0.0
) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Frames each way over 30 s, 0.2 ms and more late, and much later on one way."""

    def box_s(rig_s: float) -> float:
        return (rig_s - 115.0) * (1.0 + rate_error) + 115.0 - OFFSET_S

    times = np.arange(100.0, 130.0, 0.1).tolist()
    from_box = [(box_s(at), at + 0.0002 + rng.exponential(0.010)) for at in times]
    to_box = [(at, box_s(at + 0.0002 + rng.exponential(0.001))) for at in times]
    return from_box, to_box


@pytest.mark.parametrize("rate_error", [-0.9 * MAX_RATE_ERROR, 0.0, 0.9 * MAX_RATE_ERROR])
def test_the_true_offset_is_within_the_uncertainty_at_both_ends_of_the_run(
    rate_error: float,
) -> None:
    for seed in range(20):
        found = clock_offset(*frames(np.random.default_rng(seed), rate_error))
        for at in (-15.0, 0.0, 15.0):
            assert abs(found.offset_s - (OFFSET_S - rate_error * at)) <= found.uncertainty_s
        assert found.uncertainty_s < 0.004
        assert (found.frames_from_box, found.frames_to_box) == (300, 300)


def test_a_clock_that_jumps_has_no_offset() -> None:
    from_box, to_box = frames(np.random.default_rng(1))
    jumped = [(sent, received - 0.5 * (sent > 115.0)) for sent, received in to_box]
    with pytest.raises(ClockError, match=r"jumped in the run, by 0\.4"):
        clock_offset(from_box, jumped)


def test_one_direction_alone_bounds_nothing() -> None:
    from_box, to_box = frames(np.random.default_rng(1))
    with pytest.raises(ClockError, match="no frame to the box"):
        clock_offset(from_box, [])
    with pytest.raises(ClockError, match="no frame from the box"):
        clock_offset([], to_box)
