"""Selection of events."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True)
def take_events(
    rows: NDArray[np.int64],
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    on: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], NDArray[np.uint16], NDArray[np.uint16], NDArray[np.bool_]]:
    """Events of these indices: the four columns in one go (four times NumPy's indexing: twice as slow)."""
    count = rows.size
    t, x, y = np.empty(count, np.int64), np.empty(count, np.uint16), np.empty(count, np.uint16)
    polarity = np.empty(count, np.bool_)
    for i in range(count):
        row = np.uint64(rows[i])
        t[i], x[i], y[i], polarity[i] = t_us[row], x_px[row], y_px[row], on[row]
    return t, x, y, polarity
