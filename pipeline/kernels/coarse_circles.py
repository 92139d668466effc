"""Circles anywhere in a surface, by a Hough vote of coarse cells in octaves of radii (section 3.1)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .arrays import Bytes, Floats, Pixels
from .hough import active_cells, best_circles, twice_as_wide

# Cells that draw a circle.
LEAST_CELLS = 5
COLUMNS = 6
# More octaves of radii than any image has.
OCTAVES = 64


@njit(cache=True, nogil=True)
def coarse_circles(
    votes: Pixels,
    values: Bytes,
    x_px: Pixels,
    y_px: Pixels,
    least: int,
    cell_px: int,
    most_cells: int,
    radius_min_px: float,
    radius_max_px: float,
    most: int,
    least_support: float,
) -> Floats:
    """Circles of `best_circles` through the `active_cells`, octave by octave of radii; writes into `votes` only.

    In one call: octave by octave from Python, with its arrays, takes as long as the votes.

    Parameters
    ----------
    votes : flat uint16
        As of `best_circles`.
    values, x_px, y_px, least, cell_px
        As of `active_cells`. Cells of each further octave are twice as wide.
    most_cells : int
        Largest radius of an octave, in its cells.
    most : int
        Circles in the first octave; half as many in the next ones, but one at least.
    least_support : float
        Least support of a circle, in its cells.

    Returns
    -------
    (m, 6) float64
        Support in px of outline, width of the cells, centre x and y and radius in px, and the share of the outline.
    """
    columns, rows = active_cells(values, x_px, y_px, least, cell_px)
    found = np.empty((2 * most + OCTAVES, COLUMNS))
    m, width_px, smallest_px = 0, cell_px, radius_min_px
    while smallest_px < radius_max_px and columns.size >= LEAST_CELLS:
        largest_px = min(float(most_cells * width_px), radius_max_px)
        if smallest_px < largest_px:
            first = max(1, math.floor(smallest_px / width_px))
            radii = math.ceil(largest_px / width_px) - first + 1
            supports, circles = best_circles(votes, columns, rows, first, radii, most, least_support)
            for n in range(supports.size):
                support, radius = supports[n], circles[n, 2]
                found[m, 0], found[m, 1] = support * width_px, width_px
                found[m, 2] = (circles[n, 0] + 0.5) * width_px - 0.5
                found[m, 3] = (circles[n, 1] + 0.5) * width_px - 0.5
                found[m, 4] = radius * width_px
                found[m, 5] = min(1.0, math.sqrt(support / (2.0 * math.pi * radius)))
                m += 1
            smallest_px = largest_px
            most = max(1, most // 2)
        width_px *= 2
        columns, rows = twice_as_wide(columns, rows)
    return found[:m].copy()
