"""Order of events in time."""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Integers


@njit(cache=True)
def is_in_order(t_us: Integers) -> bool:
    """Whether times (n,) never fall.

    With Python's lock held: giving it back for some microseconds, as NumPy does, means to wait for it behind threads
    that compute.
    """
    falls = False
    for n in range(1, t_us.size):
        i = np.uint64(n)
        falls |= t_us[i] < t_us[i - np.uint64(1)]
    return not falls
