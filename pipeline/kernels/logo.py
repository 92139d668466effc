"""The logo mask: which events lie inside a moving circle (section 3.2, equations logo_cond and ball_pos)."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray


@numba.njit(cache=True, nogil=True)
def logo_rows(
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    on: NDArray[np.bool_],
    reference_us: float,
    centre_px: tuple[float, float],
    velocity_px_s: tuple[float, float],
    mask_px: float,
    rim_px: float,
    ring_px: tuple[float, float],
) -> tuple[NDArray[np.int64], NDArray[np.bool_], int, int]:
    """Rows (m,) int64 of the logo's events, which of them (m,) are inside the mask, and the outline's two polarities.

    reference_us : the time stamp that an event of the scene with the ball at `centre_px` carries
    mask_px : radius within which every event counts
    rim_px : radius within which those count that are OFF ahead of the centre or ON behind it, or all if nothing moves
    ring_px : inner and outer radius of the ring of which the ON events ahead and OFF behind are counted, and the others
    """
    rows, inside = np.empty(t_us.size, np.int64), np.empty(t_us.size, np.bool_)
    count, likes, others = 0, 0, 0
    mask2, rim2 = max(mask_px, 0.0) ** 2, max(rim_px, 0.0) ** 2
    inner2, outer2 = max(ring_px[0], 0.0) ** 2, max(ring_px[1], 0.0) ** 2
    x0, y0 = centre_px
    vx, vy = velocity_px_s[0] * 1e-6, velocity_px_s[1] * 1e-6
    still = vx == 0.0 and vy == 0.0
    for i in range(t_us.size):
        dt_us = t_us[i] - reference_us
        dx = x_px[i] - (x0 + vx * dt_us)
        dy = y_px[i] - (y0 + vy * dt_us)
        across2 = dx * dx + dy * dy
        other = (dx * vx + dy * vy > 0.0) != on[i]
        ring = (across2 > inner2) & (across2 < outer2)
        likes += ring & (not other)
        others += ring & other
        rows[count] = i  # unconditional stores: a branch here mispredicts at the outline
        inside[count] = across2 < mask2
        count += (across2 < mask2) | ((across2 < rim2) & (other | still))
    return rows[:count], inside[:count], likes, others


@numba.njit(cache=True, nogil=True)
def outline_like(
    x_px: NDArray[np.float64],
    y_px: NDArray[np.float64],
    on: NDArray[np.bool_],
    velocity_px_s: tuple[float, float],
    least_radius_px: float,
) -> NDArray[np.bool_]:
    """(n,) bool: ON ahead of the centre or OFF behind it, within 60 degrees of the motion, this far out or more.

    x_px, y_px : (n,), relative to the ball's centre
    """
    out = np.empty(x_px.size, np.bool_)
    vx, vy = velocity_px_s
    quarter, least2 = 0.25 * (vx * vx + vy * vy), least_radius_px * least_radius_px
    for i in range(x_px.size):
        across2 = x_px[i] * x_px[i] + y_px[i] * y_px[i]
        ahead = x_px[i] * vx + y_px[i] * vy
        # ahead > speed * cos(60 degrees) * distance from the centre, without a root
        out[i] = ((ahead > 0.0) == on[i]) & (ahead * ahead > quarter * across2) & (across2 > least2)
    return out
