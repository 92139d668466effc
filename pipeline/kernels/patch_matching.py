"""Displacement of patches between two pictures, by the least sum of squared differences."""

from __future__ import annotations

import numba
import numpy as np

from .arrays import Floats, Integers


@numba.njit(cache=True, nogil=True)
def patch_displacements(
    first: Floats, second: Floats, columns: Integers, rows: Integers, half_px: int, reach_px: int
) -> tuple[Floats, Floats]:
    """Displacements (m, 2), x and y in px, of the patches of `first` around places (m,), and their costs (m,).

    Whole pixels up to `reach_px` each way, then a parabola through the costs on both sides. NaN where the best is at
    the end of the reach, or no place is better than another; cost: the least sum over the mean of all.

    Parameters
    ----------
    first, second : (c, height, width) float64
        Pictures of c channels, with margins of half_px + reach_px around all places.
    half_px : int
        A patch is 2 half_px + 1 pixels wide and high.
    """
    found, shares = np.full((columns.size, 2), np.nan), np.full(columns.size, np.nan)
    size = 2 * reach_px + 1
    costs = np.empty((size, size))
    for k in range(columns.size):
        for dy in range(-reach_px, reach_px + 1):
            for dx in range(-reach_px, reach_px + 1):
                cost = 0.0
                for channel in range(first.shape[0]):
                    for j in range(-half_px, half_px + 1):
                        for i in range(-half_px, half_px + 1):
                            y, x = rows[k] + j, columns[k] + i
                            cost += (first[channel, y, x] - second[channel, y + dy, x + dx]) ** 2
                costs[dy + reach_px, dx + reach_px] = cost
        best = np.argmin(costs)
        row, column = best // size, best % size
        if not (0 < row < size - 1 and 0 < column < size - 1):
            continue
        least = costs[row, column]
        left, right = costs[row, column - 1] - least, costs[row, column + 1] - least
        above, below = costs[row - 1, column] - least, costs[row + 1, column] - least
        if left + right == 0.0 or above + below == 0.0:
            continue
        found[k, 0] = column - reach_px + 0.5 * (left - right) / (left + right)
        found[k, 1] = row - reach_px + 0.5 * (above - below) / (above + below)
        shares[k] = least * costs.size / np.sum(costs)
    return found, shares
