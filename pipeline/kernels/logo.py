"""The logo mask: which events lie inside a moving circle (section 3.2, equations logo_cond and ball_pos)."""

from __future__ import annotations

import numba
import numpy as np

from .arrays import Events, Flags, Floats, Integers


@numba.njit(cache=True, nogil=True)
def logo_rows(
    events: Events,
    reference_us: float,
    centre_px: tuple[float, float],
    velocity_px_s: tuple[float, float],
    mask_px: float,
    rim_px: float,
    ring_px: tuple[float, float],
) -> tuple[Integers, Flags, int, int]:
    """Select the events inside the moving mask.

    Parameters
    ----------
    reference_us : float
        The time stamp that an event of the scene with the ball at `centre_px` carries.
    mask_px : float
        Radius within which every event counts.
    rim_px : float
        Radius within which those count that are OFF ahead of the centre or ON behind it, or all if nothing moves.
    ring_px : (inner, outer) float
        Radii of the annulus in which the outline's events are counted.

    Returns
    -------
    rows : (m,) int64
        Indices of the logo's events.
    inside : (m,) bool
        Which of them are inside the mask.
    likes, others : int
        Events in the annulus that are ON ahead or OFF behind, as a bright ball's outline, and the others.
    """
    t_us, x_px, y_px, on = events
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
    x_px: Floats, y_px: Floats, on: Flags, velocity_px_s: tuple[float, float], least_radius_px: float
) -> Flags:
    """Mark the events (n,) that look like the outline's: ON ahead of the centre or OFF behind it, far out.

    Their places (n,) are relative to the ball's centre. Marked are those within 60 degrees of its velocity (or of the
    opposite) and at least least_radius_px from the centre.
    """
    vx, vy = velocity_px_s
    across2, ahead = x_px * x_px + y_px * y_px, x_px * vx + y_px * vy
    # ahead > speed * cos(60 degrees) * distance from the centre, without a root
    near = ahead * ahead > 0.25 * (vx * vx + vy * vy) * across2
    like: Flags = ((ahead > 0.0) == on) & near & (across2 > least_radius_px * least_radius_px)
    return like
