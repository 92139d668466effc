"""Slow, obvious twins of the rivals' kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]


def naive_variance(spin_rad_s: Floats, t_s: Floats, normals: Floats, view: Floats, cells: int) -> float:
    """Variance of one spin's image: every event's share of every cell, by its distance in columns and rows."""
    turned = Rotation.from_rotvec(-np.outer(t_s, spin_rad_s)).apply(normals)
    x, y, depth = (turned @ view.T).T
    grid = np.arange(cells)
    images = []
    for half in (depth <= 0, depth > 0):
        columns, rows = ((0.5 * (cells - 1) * (1 + place[half]))[:, None] - grid for place in (x, y))
        across, down = (np.clip(1 - np.abs(off), 0, None) for off in (columns, rows))
        images.append(down.T @ across)
    return float(np.var(images))


def naive_displacement(
    first: Floats, second: Floats, column: int, row: int, half_px: int, reach_px: int
) -> tuple[int, int]:
    """Whole pixels, x and y, by which the patch has moved: the first of the least sums of squares, row by row."""

    def patch(picture: Floats, x: int, y: int) -> Floats:
        return picture[:, y - half_px : y + half_px + 1, x - half_px : x + half_px + 1]

    reach = range(-reach_px, reach_px + 1)
    sums = {
        (dx, dy): float(np.sum((patch(first, column, row) - patch(second, column + dx, row + dy)) ** 2))
        for dy in reach
        for dx in reach
    }
    return min(sums, key=lambda moved: sums[moved])
