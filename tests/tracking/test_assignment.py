"""The cheapest assignment, against scipy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.optimize import linear_sum_assignment

from onboard.tracking.assignment import cheapest_pairs

COSTS = st.floats(-1e6, 1e6)


@given(arrays(np.float64, array_shapes(min_dims=2, max_dims=2, max_side=9), elements=COSTS))
def test_nothing_is_cheaper(costs: np.ndarray) -> None:
    pairs = cheapest_pairs(costs)

    rows, columns = zip(*pairs, strict=True)
    assert len(pairs) == min(costs.shape) == len(set(rows)) == len(set(columns))
    assert rows == tuple(sorted(rows))
    least = costs[linear_sum_assignment(costs)].sum()
    assert sum(costs[pair] for pair in pairs) == pytest.approx(least, rel=1e-9, abs=1e-6)


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (0, 0)])
def test_of_nothing_there_are_no_pairs(shape: tuple[int, int]) -> None:
    assert cheapest_pairs(np.zeros(shape)) == []


@pytest.mark.parametrize("costs", [[[np.nan, 1.0], [1.0, 2.0]], [[np.inf, 1.0], [np.inf, 2.0]]])
def test_costs_that_are_none_are_refused_and_not_searched_without_end(
    costs: list[list[float]],
) -> None:
    with pytest.raises(ValueError, match="finite"):
        cheapest_pairs(np.array(costs))


def test_a_row_gives_way_where_that_costs_less_in_all() -> None:
    """Both like column 0 best; the second would have to pay more for the other one."""
    assert cheapest_pairs(np.array([[1.0, 2.0], [1.0, 9.0]])) == [(0, 1), (1, 0)]
