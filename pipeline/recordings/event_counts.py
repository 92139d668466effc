"""Counts over successive batches of events, for the summary of a recording."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compilation import njit

PEAK_BIN_US = 1000  # the peak rate is that of the fullest millisecond
# A hot pixel has 10 events or more, and over 10 times as many as the second busiest of its 8 neighbours: a
# line in the scene that keeps firing has two busy neighbours along it. Against the truth of ten simulated
# recordings: all pixels found are hot, and they hold 90 % or more of the hot pixels' events.
HOT_EVENTS = 10
HOT_RATIO = 10

EVENTS, ON, PEAK_EVENTS, BIN_END_US, BIN_EVENTS = range(5)  # indices of `EventCounts.totals`


class EventCounts(NamedTuple):
    """Counts so far.

    Attributes
    ----------
    low_bytes : (height, width) uint8
        Events of each pixel, modulo 256: 0.9 MB for 1280 x 720 pixels, which the processor's caches hold.
    carried : (height, width) uint32
        The rest of them, multiples of 256.
    totals : (5,) int64
        Events, those that are ON, those of the fullest bin, end of the present bin in us and its events so far.
    """

    low_bytes: NDArray[np.uint8]
    carried: NDArray[np.uint32]
    totals: NDArray[np.int64]

    @classmethod
    def of_sensor(cls, width_px: int, height_px: int) -> EventCounts:
        """Counts before the first event."""
        totals = np.zeros(5, np.int64)
        totals[BIN_END_US] = -(2**63)
        size = (height_px, width_px)
        return cls(np.zeros(size, np.uint8), np.zeros(size, np.uint32), totals)

    @property
    def pixels(self) -> NDArray[np.uint32]:
        """(height, width) uint32 events of each pixel."""
        return self.carried + self.low_bytes


@njit(cache=True, nogil=True)
def count_events(
    out: EventCounts,
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    on: NDArray[np.bool_],
) -> None:
    """Add events (n,), on the sensor and in order of time, to the counts."""
    low_bytes, carried, totals = out
    for i in range(t_us.size):
        x, y = x_px[i], y_px[i]
        low_byte = np.uint8(low_bytes[y, x] + 1)
        low_bytes[y, x] = low_byte
        if low_byte == 0:
            carried[y, x] += 256
    on_events = 0
    for i in range(t_us.size):  # a loop of its own is vectorized
        on_events += on[i]
    totals[EVENTS] += t_us.size
    totals[ON] += on_events
    first = 0  # event of the present bin among these
    while first < t_us.size:
        if t_us[first] >= totals[BIN_END_US]:
            totals[BIN_END_US], totals[BIN_EVENTS] = (t_us[first] // PEAK_BIN_US + 1) * PEAK_BIN_US, 0
        end = _first_from(t_us, first, totals[BIN_END_US])
        totals[BIN_EVENTS] += end - first
        totals[PEAK_EVENTS] = max(totals[PEAK_EVENTS], totals[BIN_EVENTS])
        first = end


@njit(cache=True, nogil=True)
def _first_from(t_us: NDArray[np.int64], first: int, end_us: int) -> int:
    """Index of the first event from `first` on that is not before a time, in a search that widens as it goes on.

    Looking at few times of each bin is twice as fast as at all, and at a bin with one event it looks once.
    """
    reach = 1
    while first + reach < t_us.size and t_us[first + reach] < end_us:
        first += reach
        reach *= 2
    while reach:
        if first + reach < t_us.size and t_us[first + reach] < end_us:
            first += reach
        reach //= 2
    return first + 1


def hot_pixel_counts(pixels: NDArray[np.uint32]) -> tuple[int, int]:
    """Number of hot pixels, and of their events, from the events of each pixel (height, width)."""
    hot = np.zeros(2, np.int64)
    _count_hot(hot, pixels, np.flatnonzero(pixels.reshape(-1) >= HOT_EVENTS))
    return int(hot[0]), int(hot[1])


@njit(cache=True, nogil=True)
def _count_hot(out: NDArray[np.int64], pixels: NDArray[np.uint32], places: NDArray[np.int64]) -> None:
    """Add the number of hot pixels among those at `places`, row after row, and of their events to `out` (2,)."""
    height, width = pixels.shape
    for place in places:
        y, x = place // width, place % width
        events = int(pixels[y, x])
        busiest = second = 0
        for row in range(max(y - 1, 0), min(y + 2, height)):
            for column in range(max(x - 1, 0), min(x + 2, width)):
                if row != y or column != x:
                    around = int(pixels[row, column])
                    second = max(second, min(busiest, around))
                    busiest = max(busiest, around)
        if events > HOT_RATIO * second:
            out[0] += 1
            out[1] += events
