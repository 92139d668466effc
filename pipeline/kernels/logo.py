"""The logo mask: which events lie inside a moving circle (section 3.2, equations logo_cond and ball_pos)."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray


@numba.njit(cache=True, nogil=True)
def rows_inside(
    rows: NDArray[np.int64],
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    reference_us: float,
    centre_px: tuple[float, float],
    velocity_px_s: tuple[float, float],
    radius_px: float,
) -> int:
    """Write the rows of the events strictly inside the circle into `rows` and return how many there are.

    rows : (n,) int64, overwritten; only the first `count` entries mean anything afterwards
    reference_us : the time stamp that an event of the scene with the ball at `centre_px` carries
    radius_px : of the mask, the ball's less pad; nothing is inside if it is not positive
    """
    count = 0
    if radius_px <= 0.0:
        return count
    radius2 = radius_px * radius_px
    x0, y0 = centre_px
    vx, vy = velocity_px_s[0] * 1e-6, velocity_px_s[1] * 1e-6
    for i in range(t_us.size):
        dt_us = t_us[i] - reference_us
        dx = x_px[i] - (x0 + vx * dt_us)
        dy = y_px[i] - (y0 + vy * dt_us)
        rows[count] = i  # unconditional store: a branch here mispredicts at the outline
        count += dx * dx + dy * dy < radius2
    return count
