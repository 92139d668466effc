"""What a ball that is a little off its assumed place does to the points on it."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@numba.njit(cache=True, nogil=True)
def place_slopes(normals: Floats, facing: Floats, radius_px: Floats) -> Floats:
    """(3, 3, n) by how much the normals (3, n) change a pixel of the ball's centre x, centre y and radius.

    facing : (3, n) unit vectors from the camera to the ball's centre
    radius_px : (n,) radius of the ball that the normals were made with
    Ball far from the camera: the disc's coordinates shift and shrink, the normal stays on the sphere.
    """
    slopes = np.empty((3, 3, normals.shape[1]))
    for i in range(normals.shape[1]):
        ux, uy, uz = facing[0, i], facing[1, i], facing[2, i]
        # The image's axes as seen from the ball: across = x less its part along u, down = u cross across.
        length = math.sqrt(max(1.0 - ux * ux, 1e-12))
        ax, ay, az = (1.0 - ux * ux) / length, -ux * uy / length, -ux * uz / length
        dx, dy, dz = uy * az - uz * ay, uz * ax - ux * az, ux * ay - uy * ax
        across = ax * normals[0, i] + ay * normals[1, i] + az * normals[2, i]
        down = dx * normals[0, i] + dy * normals[1, i] + dz * normals[2, i]
        depth = math.sqrt(max(1.0 - across * across - down * down, 0.04))  # at the very rim it would have no end
        for k in range(3):
            by_across, by_down = -across, -down
            if k == 0:
                by_across, by_down = -1.0, 0.0
            elif k == 1:
                by_across, by_down = 0.0, -1.0
            by_depth = -(across * by_across + down * by_down) / depth
            slopes[k, 0, i] = (by_across * ax + by_down * dx - by_depth * ux) / radius_px[i]
            slopes[k, 1, i] = (by_across * ay + by_down * dy - by_depth * uy) / radius_px[i]
            slopes[k, 2, i] = (by_across * az + by_down * dz - by_depth * uz) / radius_px[i]
    return slopes


@numba.njit(cache=True, nogil=True)
def moved_normals(normals: Floats, slopes_px: Floats, offsets_px: Floats) -> Floats:
    """Unit normals (3, n) of a ball whose centre and radius are off by offsets_px (3,), see `place_slopes`."""
    moved = np.empty_like(normals)
    x_px, y_px, wider_px = offsets_px[0], offsets_px[1], offsets_px[2]
    for row in range(3):
        right, lower, wider = slopes_px[0, row], slopes_px[1, row], slopes_px[2, row]
        for i in range(normals.shape[1]):
            moved[row, i] = normals[row, i] + x_px * right[i] + y_px * lower[i] + wider_px * wider[i]
    for i in range(normals.shape[1]):
        shrink = 1.0 / math.sqrt(moved[0, i] ** 2 + moved[1, i] ** 2 + moved[2, i] ** 2)
        moved[0, i] *= shrink
        moved[1, i] *= shrink
        moved[2, i] *= shrink
    return moved
