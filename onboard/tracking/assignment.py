"""Rectangular linear assignment: pairs of rows and columns with the least total cost.

The shortest augmenting path algorithm (D. F. Crouse, "On implementing 2D rectangular assignment
algorithms", IEEE TAES 52(4), 2016). In most cases it is not needed: if no two rows have their least
cost in the same column, these columns are the assignment.
"""

import numpy as np
import numpy.typing as npt

Costs = npt.NDArray[np.float64]


def cheapest_pairs(costs: Costs) -> list[tuple[int, int]]:
    """Return a pair (row, column) for each row, or each column if fewer, of least total cost.

    Args:
        costs: (rows, columns), finite.

    Raises:
        ValueError: a cost is not finite; the search for the shortest path would not end.
    """
    if not np.isfinite(costs).all():
        raise ValueError("a cost is not finite")
    rows, columns = costs.shape
    if rows > columns:
        return sorted((row, column) for column, row in cheapest_pairs(costs.T))
    cheapest = costs.argmin(axis=1).tolist() if rows else []
    if len(set(cheapest)) == rows:
        return list(enumerate(cheapest))
    return _by_augmenting_paths(costs)


def _by_augmenting_paths(costs: Costs) -> list[tuple[int, int]]:
    rows, columns = costs.shape
    row_prices, column_prices = np.zeros(rows), np.zeros(columns)
    row_of: list[int | None] = [None] * columns
    column_of = [-1] * rows
    for new_row in range(rows):
        path_costs = np.full(columns, np.inf)  # of the shortest known path to each column
        previous_row = np.zeros(columns, np.intp)  # the row that this path comes from
        is_open = np.ones(columns, np.bool_)
        passed: list[tuple[int, int]] = []
        row, cost = new_row, 0.0
        while True:
            by_row = cost + costs[row] - row_prices[row] - column_prices
            is_better = is_open & (by_row < path_costs)
            path_costs[is_better] = by_row[is_better]
            previous_row[is_better] = row
            column = int(np.where(is_open, path_costs, np.inf).argmin())
            cost = float(path_costs[column])
            is_open[column] = False
            next_row = row_of[column]
            if next_row is None:
                break
            passed.append((next_row, column))
            row = next_row
        row_prices[new_row] += cost
        for passed_row, passed_column in passed:
            row_prices[passed_row] += cost - path_costs[passed_column]
            column_prices[passed_column] -= cost - path_costs[passed_column]
        while True:
            row = int(previous_row[column])
            row_of[column] = row
            column_of[row], column = column, column_of[row]
            if row == new_row:
                break
    return list(enumerate(column_of))
