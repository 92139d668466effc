"""Surfaces to compare EROS with, from the pixels' last events: accumulated frame, linear time surface."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

# No event yet: so long ago that no span reaches it, and no difference of times overflows.
NEVER_US = np.int64(-(1 << 62))


@njit(cache=True, nogil=True)
def update_last_times(
    last_us: NDArray[np.int64], t_us: NDArray[np.int64], x_px: NDArray[np.uint16], y_px: NDArray[np.uint16]
) -> None:
    """Store the times of events, in order of time, in `last_us` only.

    Parameters
    ----------
    last_us : (height, width) int64
        Time of each pixel's last event, NEVER_US at the start.
    t_us, x_px, y_px : (n,) int64, uint16, uint16
        The events.
    """
    for i in range(t_us.size):
        last_us[y_px[i], x_px[i]] = t_us[i]


@njit(cache=True, nogil=True)
def render(values: NDArray[np.uint8], last_us: NDArray[np.int64], end_us: int, span_us: int, linear: bool) -> None:
    """Write the pixels with an event in [end - span, end) into `values`.

    Parameters
    ----------
    values : (height, width) uint8
        Output, which must hold zeros.
    last_us : (height, width) int64
        As kept by `update_last_times`.
    end_us, span_us : int
        End and length of the interval.
    linear : bool
        255 (1 - age / span) with age = end - time, rounded half up; otherwise 255.
    """
    flat, last = values.reshape(-1), last_us.reshape(-1)
    start_us = end_us - span_us
    for i in range(flat.size):
        if last[i] >= start_us:
            flat[i] = np.uint8(255 * (last[i] - start_us) / span_us + 0.5) if linear else np.uint8(255)
