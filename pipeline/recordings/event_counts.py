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
    pixels : (height, width) uint32
        Events of each pixel.
    totals : (5,) int64
        Events, those that are ON, those of the fullest bin, end of the present bin in us and its events so far.
    """

    pixels: NDArray[np.uint32]
    totals: NDArray[np.int64]

    @classmethod
    def of_sensor(cls, width_px: int, height_px: int) -> EventCounts:
        """Counts before the first event."""
        totals = np.zeros(5, np.int64)
        totals[BIN_END_US] = -(2**63)
        return cls(np.zeros((height_px, width_px), np.uint32), totals)


@njit(cache=True, nogil=True)
def count_events(
    out: EventCounts,
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    on: NDArray[np.bool_],
) -> None:
    """Add events (n,), on the sensor and in order of time, to the counts."""
    pixels, totals = out
    for i in range(t_us.size):
        pixels[y_px[i], x_px[i]] += 1
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


@njit(cache=True, nogil=True)
def count_hot_pixels(out: NDArray[np.int64], pixels: NDArray[np.uint32]) -> None:
    """Write the number of hot pixels, and of their events, into `out` (2,), from the events of each pixel."""
    height, width = pixels.shape
    out[:] = 0
    for y in range(height):
        for x in range(width):
            events = int(pixels[y, x])
            if events < HOT_EVENTS:
                continue
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
