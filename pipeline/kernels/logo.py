"""The logo mask: which events lie inside a moving circle (section 3.2, equations logo_cond and ball_pos)."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray


@numba.njit(cache=True, nogil=True)
def rows_inside(
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    reference_us: float,
    centre_px: tuple[float, float],
    velocity_px_s: tuple[float, float],
    radius_px: float,
) -> NDArray[np.int64]:
    """Rows (m,) int64 of the events strictly inside the circle.

    reference_us : the time stamp that an event of the scene with the ball at `centre_px` carries
    radius_px : of the mask, the ball's less pad; nothing is inside if it is not positive
    """
    rows = np.empty(t_us.size, np.int64)
    count = 0
    if radius_px <= 0.0:
        return rows[:0]
    radius2 = radius_px * radius_px
    x0, y0 = centre_px
    vx, vy = velocity_px_s[0] * 1e-6, velocity_px_s[1] * 1e-6
    for i in range(t_us.size):
        dt_us = t_us[i] - reference_us
        dx = x_px[i] - (x0 + vx * dt_us)
        dy = y_px[i] - (y0 + vy * dt_us)
        rows[count] = i  # unconditional store: a branch here mispredicts at the outline
        count += dx * dx + dy * dy < radius2
    return rows[:count]


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


@numba.njit(cache=True, nogil=True)
def outline_polarity(
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    on: NDArray[np.bool_],
    reference_us: float,
    centre_px: tuple[float, float],
    velocity_px_s: tuple[float, float],
    ring_px: tuple[float, float],
) -> tuple[int, int]:
    """How many events of a ring around the moving centre are ON ahead of it or OFF behind it, and how many are not.

    ring_px : its two radii; reference_us : see `rows_inside`
    """
    likes, others = 0, 0
    inner2, outer2 = ring_px[0] * ring_px[0], ring_px[1] * ring_px[1]
    vx, vy = velocity_px_s[0] * 1e-6, velocity_px_s[1] * 1e-6
    for i in range(t_us.size):
        dt_us = t_us[i] - reference_us
        dx = x_px[i] - (centre_px[0] + vx * dt_us)
        dy = y_px[i] - (centre_px[1] + vy * dt_us)
        across2 = dx * dx + dy * dy
        within = (across2 > inner2) & (across2 < outer2)
        like = (dx * vx + dy * vy > 0.0) == on[i]
        likes += within & like
        others += within & (not like)
    return likes, others
