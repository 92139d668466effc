"""What the contrast score looks at: events cut into segments, thinned, and the same events at exchanged times."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
GOLDEN = 0.6180339887498949  # its multiples modulo 1 spread as evenly as any sequence can


class Window(NamedTuple):
    """Arguments of the kernel `score`, in its order: t_s is relative to the reference time."""

    t_s: Floats
    normals: Floats
    layers: Integers
    starts: Integers
    other_t_s: Floats
    other_rows: Integers
    other_starts: Integers


@numba.njit(cache=True, nogil=True)
def exchanged(t_s: Floats, starts: Integers, times_each: int) -> tuple[Floats, Integers, Integers]:
    """Times (m,), rows (m,) and segment starts (k + 1,): each event at `times_each` times of its own segment.

    The times are those of the segment's events at ranks spread evenly, shifted from event to event by the golden
    ratio: an even mixture of place and time without random numbers. A segment of one event gets none.
    """
    segments = starts.size - 1
    other_starts = np.zeros(segments + 1, np.int64)
    for k in range(segments):
        count = starts[k + 1] - starts[k]
        other_starts[k + 1] = other_starts[k] + (count * times_each if count > 1 else 0)
    other_t_s = np.empty(other_starts[-1])
    rows = np.empty(other_starts[-1], np.int64)
    for k in range(segments):
        first, count = starts[k], starts[k + 1] - starts[k]
        if count < 2:
            continue
        at = other_starts[k]
        for i in range(count):
            shift = (i * GOLDEN) % 1.0
            for j in range(times_each):
                other_t_s[at] = t_s[first + int((j + shift) / times_each * count)]
                rows[at] = first + i
                at += 1
    return other_t_s, rows, other_starts


def window(
    t_s: Floats,
    normals: Floats,
    layers: Integers,
    *,
    segment_s: float,
    most: int,
    most_each: int,
    times_each: int,
) -> Window:
    """The events as one window of segments no longer than segment_s, thinned evenly.

    Events within a segment are thinned to about `most_each` on average, then whole segments are left out, evenly,
    until at most about `most` events are left: thinning alone would leave no pairs.
    """
    number = ((t_s - t_s[0]) / segment_s).astype(np.int64) if t_s.size else np.empty(0, np.int64)
    starts = np.append(np.flatnonzero(np.diff(number, prepend=-1)), t_s.size)
    stride = max(1, round(t_s.size / max(starts.size - 1, 1) / most_each))
    rows = np.arange(0, t_s.size, stride)
    if rows.size > most:
        segment = np.searchsorted(starts, rows, side="right") - 1
        rows = rows[segment % -(-rows.size // most) == 0]
    kept, number = t_s[rows], number[rows]
    starts = np.append(np.flatnonzero(np.diff(number, prepend=-1)), rows.size).astype(np.int64)
    return Window(
        kept,
        np.ascontiguousarray(normals[rows]),
        layers[rows],
        starts,
        *exchanged(kept, starts, times_each),
    )
