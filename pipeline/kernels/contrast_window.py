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
    """Arguments of the kernel `score`, in its order; t_s is relative to the reference time, normals are (3, n)."""

    t_s: Floats
    normals: Floats
    layers: Integers
    starts: Integers
    other_t_s: Floats
    other_normals: Floats
    other_layers: Integers
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


@numba.njit(cache=True, nogil=True)
def segment_starts(t_s: Floats, segment_s: float) -> Integers:
    """(k + 1,) int64, rows at which the segments that hold events start, and the number of events."""
    starts = np.empty(t_s.size + 1, np.int64)
    count, number = 0, -1
    for i in range(t_s.size):
        at = int((t_s[i] - t_s[0]) / segment_s)
        if at != number:
            starts[count] = i
            count, number = count + 1, at
    starts[count] = t_s.size
    return starts[: count + 1]


@numba.njit(cache=True, nogil=True)
def whole(t_s: Floats, normals: Floats, layers: Integers, times_each: int) -> tuple[Window, Integers]:
    """All events (normals (3, n)) as one segment, and the rows of its exchanged events."""
    starts = np.array([0, t_s.size], np.int64)
    return _window(t_s, normals, layers, starts, times_each)


@numba.njit(cache=True, nogil=True)
def segmented(
    t_s: Floats, normals: Floats, layers: Integers, segment_s: float, most: int, most_each: int
) -> tuple[Window, Integers]:
    """The events (normals (3, n)) in segments no longer than segment_s, thinned evenly.

    Events within a segment are thinned to about `most_each` on average, then whole segments are left out, evenly,
    until about `most` events are left: thinning alone would leave no pairs.
    """
    bounds = segment_starts(t_s, segment_s)
    segments = bounds.size - 1
    stride = max(1, int(t_s.size / max(segments, 1) / most_each + 0.5))
    left = (t_s.size + stride - 1) // stride
    every = max(1, -(-left // most))
    rows, starts = np.empty(left, np.int64), np.empty(segments + 1, np.int64)
    kept, count = 0, 0
    for k in range(0, segments, every):
        starts[count] = kept
        for i in range(-(-bounds[k] // stride) * stride, bounds[k + 1], stride):
            rows[kept] = i
            kept += 1
        if kept > starts[count]:
            count += 1
    starts[count] = kept
    rows = rows[:kept]
    return _window(t_s[rows], _columns(normals, rows), layers[rows], starts[: count + 1], 1)


@numba.njit(cache=True, nogil=True)
def _columns(table: Floats, rows: Integers) -> Floats:
    """Columns of a (3, n) table."""
    picked = np.empty((3, rows.size))
    for row in range(3):
        for i in range(rows.size):
            picked[row, i] = table[row, rows[i]]
    return picked


@numba.njit(cache=True, nogil=True)
def _window(
    t_s: Floats, normals: Floats, layers: Integers, starts: Integers, times_each: int
) -> tuple[Window, Integers]:
    other_t_s, rows, other_starts = exchanged(t_s, starts, times_each)
    part = Window(t_s, normals, layers, starts, other_t_s, _columns(normals, rows), layers[rows], other_starts)
    return part, rows
