"""The cheapest way to give each of some rows a column of its own, at most one row to a column.

The shortest augmenting path algorithm (D. F. Crouse, "On implementing 2D rectangular assignment
algorithms", IEEE TAES 52(4), 2016), after the look that mostly settles it: where no two rows like
the same column best, each gets that one.
"""

import numpy as np
import numpy.typing as npt

Costs = npt.NDArray[np.float64]


def cheapest_pairs(costs: Costs) -> list[tuple[int, int]]:
    """Return as many pairs (row, column) as the shorter side of `costs` has, of least cost in all.

    Args:
        costs: (rows, columns), finite.

    Raises:
        ValueError: they are not; no path would be the shortest, and the search for it without end.
    """
    if not np.isfinite(costs).all():
        raise ValueError("a cost is not finite")
    rows, columns = costs.shape
    if rows > columns:
        return sorted((row, column) for column, row in cheapest_pairs(costs.T))
    favourites = costs.argmin(axis=1).tolist() if rows else []
    if len(set(favourites)) == rows:
        return list(enumerate(favourites))
    return _by_augmenting_paths(costs)


def _by_augmenting_paths(costs: Costs) -> list[tuple[int, int]]:
    rows, columns = costs.shape
    row_prices, column_prices = np.zeros(rows), np.zeros(columns)
    row_of: list[int | None] = [None] * columns
    column_of = [-1] * rows
    for new_row in range(rows):
        dearness = np.full(columns, np.inf)  # of the shortest path known to each column
        before = np.zeros(columns, np.intp)  # the row that this path comes from
        is_open = np.ones(columns, np.bool_)
        passed: list[tuple[int, int]] = []
        row, so_far = new_row, 0.0
        while True:
            by_row = so_far + costs[row] - row_prices[row] - column_prices
            is_better = is_open & (by_row < dearness)
            dearness[is_better] = by_row[is_better]
            before[is_better] = row
            column = int(np.where(is_open, dearness, np.inf).argmin())
            so_far = float(dearness[column])
            is_open[column] = False
            next_row = row_of[column]
            if next_row is None:
                break
            passed.append((next_row, column))
            row = next_row
        row_prices[new_row] += so_far
        for passed_row, passed_column in passed:
            row_prices[passed_row] += so_far - dearness[passed_column]
            column_prices[passed_column] -= so_far - dearness[passed_column]
        while True:
            row = int(before[column])
            row_of[column] = row
            column_of[row], column = column, column_of[row]
            if row == new_row:
                break
    return list(enumerate(column_of))
