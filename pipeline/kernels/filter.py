"""STC and TRAIL: filters of the bursts of a pixel (supplement, section 'Filters').

Per pixel only its last event counts, passed or not: whether it had the same polarity and how long ago it was.

- STC (spatio-temporal contrast) passes an event that repeats its pixel's last polarity within the threshold:
  the second and all later events of a burst, but nothing that stands alone.
- TRAIL passes an event that changes its pixel's polarity or comes the threshold or more after the last event:
  the first event of a burst.
- STC-cut-TRAIL passes what STC does, but only one event until the polarity changes: the second of a burst.

A pixel's very first event counts as a change after an endless pause: TRAIL passes it, STC does not.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Events, Integers

OFF, STC, TRAIL, STC_CUT_TRAIL = range(4)

# State of a pixel, packed so that an event touches one word: 8 x the time of its last event (us) + one PASSED
# bit a filter (set when the filter has passed an event since the polarity changed) + the polarity (1 = ON).
PASSED, PASSED_2 = 2, 4
# No event yet: an OFF event 18,000 years before time 0, so that no difference of times overflows.
NEVER = np.int64(-(1 << 62))
# Pixels fetched ahead of their use. Their cache misses then overlap: 3 x faster on events all over a 1280 x
# 720 sensor, no loss on a ball's.
AHEAD = np.uint64(64)


@njit(cache=True, nogil=True)
def _passes(mode: int, same: bool, pause_us: int, threshold_us: int, passed_before: bool) -> bool:
    """Decide whether an event passes; same = polarity of the pixel's last event, pause_us = time since then."""
    if mode == STC:
        return same & (pause_us <= threshold_us)
    if mode == TRAIL:
        return (not same) | (pause_us >= threshold_us)
    if mode == STC_CUT_TRAIL:
        return same & (pause_us <= threshold_us) & (not passed_before)
    return True


@njit(cache=True, nogil=True)
def filter_events(
    last: Integers,
    width_px: int,
    events: Events,
    mode: int,
    threshold_us: int,
    mode_2: int,
    threshold_2_us: int,
) -> tuple[Integers, Integers]:
    """Apply two filters to events; writes into `last` only.

    Both in one go, because they share the pixels' last events and fetching these is most of the work.

    Parameters
    ----------
    last : (height x width,) int64
        The pixels' states, NEVER at the start.
    width_px : int
        Width of the image.
    mode, mode_2 : int
        OFF, STC, TRAIL or STC_CUT_TRAIL.

    Returns
    -------
    rows, rows_2 : (m,) int64
        Rising indices of the events that each filter passes.
    """
    t_us, x_px, y_px, on = events
    # Unsigned indices need no check for negative ones: a quarter faster.
    count, width = np.uint64(t_us.size), np.uint64(width_px)
    rows, rows_2 = np.empty(t_us.size, np.int64), np.empty(t_us.size, np.int64)
    m, m_2 = np.uint64(0), np.uint64(0)
    pixels = np.empty(AHEAD, np.uint64)
    for first in range(np.uint64(0), count, AHEAD):
        end = min(first + AHEAD, count)
        for n in range(first, end):
            i = np.uint64(n)
            pixels[i - first] = np.uint64(y_px[i]) * width + np.uint64(x_px[i])
            rows[i] = last[pixels[i - first]]  # overwritten below: read only to fetch the pixel's state
        for n in range(first, end):
            i = np.uint64(n)
            pixel = pixels[i - first]
            state = last[pixel]
            polarity = np.int64(on[i])
            same = (state & 1) == polarity
            pause_us = t_us[i] - (state >> 3)
            passed_before = same & ((state & PASSED) != 0)
            passed_before_2 = same & ((state & PASSED_2) != 0)
            passes = np.int64(_passes(mode, same, pause_us, threshold_us, passed_before))
            passes_2 = np.int64(_passes(mode_2, same, pause_us, threshold_2_us, passed_before_2))
            bits = (passes | passed_before) * PASSED | (passes_2 | passed_before_2) * PASSED_2 | polarity
            last[pixel] = t_us[i] * 8 | bits
            rows[m] = i  # stays only if counted: no branch to mispredict
            m += np.uint64(passes)
            rows_2[m_2] = i
            m_2 += np.uint64(passes_2)
    return rows[:m], rows_2[:m_2]
