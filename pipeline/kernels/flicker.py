"""Suppression of lamp flicker: events that come again at their pixel in every period of the lamps.

A comb over the events of a pixel, as the linear comb filter of Wang et al. (2022) is one over its brightness: an event
is flicker if events of its polarity came at its pixel one and two periods before it, each to within a bin and a half. A
linear filter gives new events at new times; here every event that is kept stays as it was, for the logo's need their
times. The third event of a row is the first to be recognised.

A pixel's past is kept as bits: one a bin of a sixteenth of a period, for as long as the two periods reach back.

References
----------
Z. Wang, D. Yuan, Y. Ng, R. Mahony, "A linear comb filter for event flicker removal", ICRA 2022.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Events, Flags, Integers

BINS = 16  # of a period: 0.6 ms, of which the times of flicker's events scatter less
ALL = np.int64((1 << (2 * BINS + 2)) - 1)  # the bits that are looked at: up to a bin more than two periods
ONE_PERIOD, TWO_PERIODS = np.int64(7 << (BINS - 1)), np.int64(7 << (2 * BINS - 1))
COLUMNS = 3  # of a pixel's state: the newest bin, the bits of OFF and of ON events


def empty_history(pixels: int) -> Integers:
    """(pixels, COLUMNS) int64 state of pixels that have seen no event."""
    return np.zeros((pixels, COLUMNS), np.int64)


@njit(cache=True, nogil=True)
def recurring(history: Integers, width_px: int, events: Events, flicker_hz: int) -> Flags:
    """Find the events that come again in every period; writes into `history` only.

    Parameters
    ----------
    history : (height x width, COLUMNS) int64
        The pixels' states, as made by `empty_history`.
    width_px : int
        Width of the image.
    flicker_hz : int
        Of the light: twice the mains' frequency.

    Returns
    -------
    (n,) bool
        Whether each event is flicker.
    """
    t_us, x_px, y_px, on = events
    found = np.empty(t_us.size, np.bool_)
    for i in range(t_us.size):
        p = np.int64(y_px[i]) * width_px + np.int64(x_px[i])
        newest = t_us[i] * (BINS * flicker_hz) // 1_000_000
        passed = newest - history[p, 0]
        history[p, 0] = newest
        for polarity in range(1, COLUMNS):
            history[p, polarity] = (history[p, polarity] << passed) & ALL if passed < 2 * BINS + 2 else 0
        bits = history[p, 1 + np.int64(on[i])]
        found[i] = (bits & ONE_PERIOD) != 0 and (bits & TWO_PERIODS) != 0
        history[p, 1 + np.int64(on[i])] = bits | 1
    return found
