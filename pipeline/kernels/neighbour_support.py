"""Events with a neighbour's support: a noise filter that spares outlines of one event a pixel (Delbruck 2008)."""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Events, Integers, Pixels

# Events that span more are all taken for simultaneous at the end.
MOST_US = 65_535


@njit(cache=True, nogil=True)
def supported_events(last_us: Pixels, events: Events, within_us: int) -> Integers:
    """Indices (m,) int64 of events with an earlier one in one of the eight pixels around; writes into `last_us` only.

    Parameters
    ----------
    last_us : (height + 2, width + 2) uint16
        Time of each pixel's last event less the first one's, plus one, at most 65,535; zeros at the start and again at
        the end, so that it can be used again: a new one costs more than the work. Two bytes a pixel, as fetching them
        is most of that. The frame of one pixel around the image stays empty.
    within_us : int
        Longest time between an event and its neighbour's.
    """
    t_us, x_px, y_px, _ = events
    chosen = np.empty(t_us.size, np.int64)
    m = 0
    for i in range(t_us.size):
        row, column = np.int64(y_px[i]) + 1, np.int64(x_px[i]) + 1
        now_us = min(t_us[i] - t_us[0] + 1, MOST_US)
        newest_us = np.int64(0)
        for y in range(row - 1, row + 2):
            for x in range(column - 1, column + 2):
                if y != row or x != column:
                    newest_us = max(newest_us, np.int64(last_us[y, x]))
        last_us[row, column] = now_us
        chosen[m] = i
        m += (newest_us > 0) & (now_us - newest_us <= within_us)
    for i in range(t_us.size):
        last_us[np.int64(y_px[i]) + 1, np.int64(x_px[i]) + 1] = 0
    return chosen[:m].copy()
