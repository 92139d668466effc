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


def segment_starts(t_s: Floats, segment_s: float) -> Integers:
    """(k + 1,) int64, rows at which the segments that hold events start, and the number of events."""
    number = np.floor((t_s - t_s[:1]) / segment_s)
    starts = np.flatnonzero(np.diff(number, prepend=-1.0))
    return np.append(starts, t_s.size).astype(np.int64)


def whole(t_s: Floats, normals: Floats, layers: Integers, times_each: int) -> tuple[Window, Integers]:
    """All events (normals (3, n)) as one segment, and the rows of its exchanged events."""
    starts = np.array([0, t_s.size], np.int64)
    return _window(t_s, normals, layers, starts, times_each)


def segmented(t_s: Floats, normals: Floats, layers: Integers, *, segment_s: float, most: int, most_each: int) -> Window:
    """The events (normals (3, n)) in segments no longer than segment_s, thinned evenly.

    Events within a segment are thinned to about `most_each` on average, then whole segments are left out, evenly,
    until about `most` events are left: thinning alone would leave no pairs.
    """
    starts = segment_starts(t_s, segment_s)
    stride = max(1, round(t_s.size / max(starts.size - 1, 1) / most_each))
    rows = np.arange(0, t_s.size, stride)
    segment = np.searchsorted(starts, rows, side="right")
    if rows.size > most:
        keep = segment % -(-rows.size // most) == 0
        rows, segment = rows[keep], segment[keep]
    starts = np.append(np.flatnonzero(np.diff(segment, prepend=-1)), rows.size).astype(np.int64)
    return _window(t_s[rows], np.ascontiguousarray(normals[:, rows]), layers[rows], starts, 1)[0]


def _window(
    t_s: Floats, normals: Floats, layers: Integers, starts: Integers, times_each: int
) -> tuple[Window, Integers]:
    other_t_s, rows, other_starts = exchanged(t_s, starts, times_each)
    other_normals = np.ascontiguousarray(normals[:, rows])
    part = Window(t_s, normals, layers, starts, other_t_s, other_normals, layers[rows], other_starts)
    return part, rows
