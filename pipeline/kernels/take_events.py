"""Selection of events."""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Events, Integers


@njit(cache=True, nogil=True)
def take_events(rows: Integers, events: Events) -> Events:
    """Events of these indices: the four columns in one go (four times NumPy's indexing: twice as slow)."""
    t_us, x_px, y_px, on = events
    t, x, y = np.empty(rows.size, np.int64), np.empty(rows.size, np.uint16), np.empty(rows.size, np.uint16)
    polarity = np.empty(rows.size, np.bool_)
    for i in range(rows.size):
        row = np.uint64(rows[i])
        t[i], x[i], y[i], polarity[i] = t_us[row], x_px[row], y_px[row], on[row]
    return t, x, y, polarity


@njit(cache=True, nogil=True)
def take_others(rows: Integers, events: Events) -> Events:
    """Events of all indices but these rising ones."""
    t_us, x_px, y_px, on = events
    count = t_us.size - rows.size
    t, x, y = np.empty(count, np.int64), np.empty(count, np.uint16), np.empty(count, np.uint16)
    polarity = np.empty(count, np.bool_)
    first = 0
    for n in range(rows.size + 1):
        end = rows[n] if n < rows.size else t_us.size
        for i in range(first, end):
            place, row = np.uint64(i - n), np.uint64(i)
            t[place], x[place], y[place], polarity[place] = t_us[row], x_px[row], y_px[row], on[row]
        first = end + 1
    return t, x, y, polarity
