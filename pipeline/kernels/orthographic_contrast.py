"""Contrast of events turned back on a sphere and seen from far away: the variance of their image."""

from __future__ import annotations

import numba
import numpy as np

from .arrays import Floats
from .rotation import axis_and_length, rotate


@numba.njit(cache=True, nogil=True)
def orthographic_variances(spins_rad_s: Floats, t_s: Floats, normals: Floats, view: Floats, cells: int) -> Floats:
    """Variance (m,) of the image of the events, each turned back by a spin (m, 3), rad/s, to time 0.

    The image is the orthographic one along `view`: one of the near and one of the far hemisphere, `cells` squared cells
    over the square around the disc each, with each event spread over four cells linearly.

    Parameters
    ----------
    t_s : (n,) float64
        Time of each event, s.
    normals : (n, 3) float64
        Its unit vector from the ball's centre at that time.
    view : (3, 3) float64
        Orthonormal rows: two axes of the image, and the line of sight away from the camera.
    """
    variances = np.empty(spins_rad_s.shape[0])
    image = np.empty((2, cells, cells))
    last = cells - 1
    for m in range(spins_rad_s.shape[0]):
        ax, ay, az, speed = axis_and_length(spins_rad_s[m])
        image[:] = 0.0
        for k in range(t_s.size):
            angle = -speed * t_s[k]
            sine, cosine = np.sin(angle), np.cos(angle)
            x, y, z = rotate((normals[k, 0], normals[k, 1], normals[k, 2]), (ax, ay, az), sine, cosine, 1.0 - cosine)
            side = 1 if view[2, 0] * x + view[2, 1] * y + view[2, 2] * z > 0.0 else 0
            u = 0.5 * last * (1.0 + view[0, 0] * x + view[0, 1] * y + view[0, 2] * z)
            v = 0.5 * last * (1.0 + view[1, 0] * x + view[1, 1] * y + view[1, 2] * z)
            column, row = min(max(int(u), 0), last - 1), min(max(int(v), 0), last - 1)
            right, down = u - column, v - row
            image[side, row, column] += (1.0 - right) * (1.0 - down)
            image[side, row, column + 1] += right * (1.0 - down)
            image[side, row + 1, column] += (1.0 - right) * down
            image[side, row + 1, column + 1] += right * down
        mean, square = 0.0, 0.0
        for value in image.ravel():
            mean += value
            square += value * value
        mean /= image.size
        variances[m] = square / image.size - mean * mean
    return variances
