"""Surfaces to compare EROS with, from the pixels' last events: accumulated frame, linear time surface."""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Bytes, Integers, Pixels

# No event yet: so long ago that no span reaches it, and no difference of times overflows.
NEVER_US = np.int64(-(1 << 62))


@njit(cache=True, nogil=True)
def update_last_times(last_us: Integers, t_us: Integers, x_px: Pixels, y_px: Pixels) -> None:
    """Store the times of events in `last_us` (height, width), which holds NEVER_US at the start, and only there."""
    for i in range(t_us.size):
        last_us[y_px[i], x_px[i]] = t_us[i]


@njit(cache=True, nogil=True)
def render(values: Bytes, last_us: Integers, end_us: int, span_us: int, linear: bool) -> None:
    """Write the pixels with an event in [end - span, end) into `values` (height, width), which must hold zeros.

    Their value is 255 or, if `linear`, 255 (1 - age / span) with age = end - time, rounded half up.
    """
    flat, last = values.reshape(-1), last_us.reshape(-1)
    start_us = end_us - span_us
    for i in range(flat.size):
        if last[i] >= start_us:
            flat[i] = np.uint8(255 * (last[i] - start_us) / span_us + 0.5) if linear else np.uint8(255)
