"""Triplet Matching: flow from three events at even intervals (Shiba, Aoki, Gallego, IEEE SPL 2022).

An edge that moves evenly fires at x, x + d, x + 2d at times t, t + dt, t + 2dt. Every such triplet of one polarity
votes with its velocity for the flow of its newest event; an event's flow is the weighted mean of its votes, where a
Gaussian weight falls with the triplet's mismatch in space and time. Along a straight edge all displacements that end
on the edge match, and their mean is the flow across the edge: the method sees normal flow there, as any local one.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from .arrays import Floats, Integers, PlacedEvents


@numba.njit(cache=True, nogil=True)
def earlier_neighbours(
    events: PlacedEvents, near_px: float, reach_px: float, reach_us: float, speed_max_px_s: float, most: int
) -> NDArray[np.int32]:
    """Latest earlier neighbours of each event.

    Parameters
    ----------
    near_px, reach_px, reach_us, speed_max_px_s : float
        A neighbour has the same polarity, is near_px..reach_px away and at most reach_us older, and the velocity
        between the two is not higher.
    most : int
        The search back stops at so many neighbours.

    Returns
    -------
    (n, most) int32
        Indices, latest first, -1 where there are fewer.
    """
    t_us, x_px, y_px, on = events
    n = t_us.size
    neighbours = np.full((n, most), -1, np.int32)
    near2, reach2, speed_px_us = near_px * near_px, reach_px * reach_px, speed_max_px_s * 1e-6
    for k in range(n):
        count = 0
        for j in range(k - 1, -1, -1):
            dt_us = t_us[k] - t_us[j]
            if dt_us > reach_us or count == most:
                break
            if dt_us <= 0 or on[j] != on[k]:
                continue
            dx, dy = x_px[k] - x_px[j], y_px[k] - y_px[j]
            d2 = dx * dx + dy * dy
            if near2 <= d2 <= reach2 and d2 <= (speed_px_us * dt_us) ** 2:
                neighbours[k, count] = j
                count += 1
    return neighbours


@numba.njit(cache=True, nogil=True)
def triplet_flow(
    t_us: Integers, x_px: Floats, y_px: Floats, neighbours: NDArray[np.int32], mismatch_px: float, mismatch_share: float
) -> tuple[Floats, Floats, Integers]:
    """Flow of the events that end a triplet.

    Parameters
    ----------
    neighbours : (n, most) int32
        As from `earlier_neighbours`.
    mismatch_px : float
        1 sigma of the difference between a triplet's two displacements; beyond two sigma it does not match.
    mismatch_share : float
        The same of its two durations, as a share of their mean.

    Returns
    -------
    vx_px_s, vy_px_s : (n,) float64
        NaN where an event ends no triplet.
    triplets : (n,) int64
        Number of triplets behind each.
    """
    n, most = neighbours.shape
    vx, vy, triplets = np.full(n, np.nan), np.full(n, np.nan), np.zeros(n, np.int64)
    for k in range(n):
        weight_sum, vx_sum, vy_sum, count = 0.0, 0.0, 0.0, 0
        for a in range(most):
            j = neighbours[k, a]
            if j < 0:
                break
            for b in range(most):
                i = neighbours[j, b]
                if i < 0:
                    break
                off_x = (x_px[k] - 2.0 * x_px[j] + x_px[i]) / mismatch_px
                off_y = (y_px[k] - 2.0 * y_px[j] + y_px[i]) / mismatch_px
                span_us = float(t_us[k] - t_us[i])
                off_t = (t_us[k] - 2 * t_us[j] + t_us[i]) / (0.5 * mismatch_share * span_us)
                off2_space, off2_time = off_x * off_x + off_y * off_y, off_t * off_t
                if off2_space > 4.0 or off2_time > 4.0:
                    continue
                weight = np.exp(-0.5 * (off2_space + off2_time))
                weight_sum += weight
                vx_sum += weight * (x_px[k] - x_px[i]) / span_us
                vy_sum += weight * (y_px[k] - y_px[i]) / span_us
                count += 1
        if count:
            vx[k], vy[k] = vx_sum / weight_sum * 1e6, vy_sum / weight_sum * 1e6
            triplets[k] = count
    return vx, vy, triplets
