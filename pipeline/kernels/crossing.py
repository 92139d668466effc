"""Events of balls whose outlines overlap in the image."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .arrays import Events, Floats, Integers


@njit(cache=True, nogil=True)
def nearest_outline(circle: Floats, others: Floats, events: Events, reference_us: float) -> Integers:
    """Indices (k,) int64 of events that lie at least as near to a moving circle's outline as to any of the others.

    Parameters
    ----------
    circle : (5,) float64
        As in `moving_circle`, at the reference time.
    others : (m, 5) float64
    """
    t_us, x_px, y_px, _ = events
    near = np.empty(t_us.size, np.int64)
    count = 0
    for i in range(t_us.size):
        tau = (t_us[i] - reference_us) * 1e-6
        dx, dy = x_px[i] - (circle[0] + circle[2] * tau), y_px[i] - (circle[1] + circle[3] * tau)
        own = abs(math.sqrt(dx * dx + dy * dy) - circle[4])
        is_own = True
        for other in others:
            dx, dy = x_px[i] - (other[0] + other[2] * tau), y_px[i] - (other[1] + other[3] * tau)
            is_own &= own <= abs(math.sqrt(dx * dx + dy * dy) - other[4])
        near[count] = i
        count += is_own
    return near[:count].copy()
