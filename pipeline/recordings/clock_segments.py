"""Segments of a recording between which the camera's clock was set back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from .order import NO_TIME_US
from .reader import LAST_US, MAX_DISORDER_US, ReadPass, UncheckedEvents

# So many events in a row that go on from a time before those so far are a clock that was set back, fewer are late or
# damaged: a quiet scene has as many in some milliseconds, and random times do not stand in order.
SEGMENT_EVENTS = 100


class ClockSegments:
    """Joins segments into one: behind a clock that was set back, time goes on from the last event before.

    A software's reset or a pulse on the sync input sets the clock back, whatever came before; no event of a longer
    segment is dropped. Fewer than SEGMENT_EVENTS at the start, before the clock is set back, are stale unless one
    of them is late: what the camera's buffers held of an earlier recording.

    Attributes
    ----------
    shift_us : int
        Added to the times of the file in the present segment.
    """

    def __init__(self, reading: ReadPass, latest_us: int = NO_TIME_US, shift_us: int = 0) -> None:
        """Begin at the start of the file, or behind a time (with the shift added)."""
        self._reading = reading
        self.shift_us = shift_us
        self._has_begun = latest_us != NO_TIME_US  # whether events of the segment were handed on
        self._latest_us = latest_us - shift_us if self._has_begun else NO_TIME_US
        self._held = UncheckedEvents.empty()

    @property
    def is_settled(self) -> bool:
        """Whether all events taken so far were handed on or dropped."""
        return not len(self._held)

    def joined(self, parts: Iterable[UncheckedEvents]) -> Iterator[tuple[UncheckedEvents, bool]]:
        """Yield the events of all parts, none of them empty, with the shift added.

        With each part comes whether its events are known to be in order.
        """
        for part in parts:
            yield from self._take(part, final=False)
        yield from self._take(UncheckedEvents.empty(), final=True)

    def _take(self, new: UncheckedEvents, final: bool) -> Iterator[tuple[UncheckedEvents, bool]]:
        events = UncheckedEvents.concatenate([self._held, new]) if len(self._held) else new
        self._held = UncheckedEvents.empty()
        rises = not np.any(events.t_us[1:] < events.t_us[:-1])
        while len(events):
            first, count = self._first_late(events.t_us, rises), len(events)
            is_sure = final or first == count or count - first >= SEGMENT_EVENTS
            is_open = not self._has_begun and first < SEGMENT_EVENTS  # what is stale is not known yet
            if not final and is_open and (count < SEGMENT_EVENTS or not is_sure):
                is_sure, first = False, 0
            if is_sure and first < count and self._is_set_back(events.t_us, first):
                yield from self._set_back(events[:first], rises, int(events.t_us[first]))
                events = events[first:]
                continue
            upto = self._end_of_late(events.t_us, first) if is_sure else first
            yield from self._hand_on(events[:upto], rises)
            if not is_sure:
                self._held = events[upto:]
                return
            events = events[upto:]

    def _first_late(self, t_us: NDArray[np.int64], rises: bool) -> int:
        """Index of the first event that is late; their number where none is."""
        if rises and t_us[0] >= self._latest_us:
            return t_us.size
        if t_us[0] < self._latest_us - MAX_DISORDER_US:
            return 0
        late = t_us < np.maximum(np.maximum.accumulate(t_us), self._latest_us) - MAX_DISORDER_US
        return int(np.argmax(late)) if late.any() else t_us.size

    def _latest_before(self, t_us: NDArray[np.int64], first: int) -> int:
        return max(self._latest_us, int(t_us[:first].max()) if first else NO_TIME_US)

    def _is_set_back(self, t_us: NDArray[np.int64], first: int) -> bool:
        """Whether SEGMENT_EVENTS events from `first` on are late and in order; not those of a file sorted backwards.

        No clock is set back so far that times with the shift do not fit in 64 bits.
        """
        run = t_us[first : first + SEGMENT_EVENTS]
        rises = np.count_nonzero(run[1:] < run[:-1]) <= SEGMENT_EVENTS // 2
        in_order = bool(rises and np.all(run >= np.maximum.accumulate(run) - MAX_DISORDER_US))
        latest_us = self._latest_before(t_us, first)
        fits = self.shift_us + latest_us - int(t_us[first]) < LAST_US
        return run.size == SEGMENT_EVENTS and in_order and bool(np.all(run < latest_us - MAX_DISORDER_US)) and fits

    def _end_of_late(self, t_us: NDArray[np.int64], first: int) -> int:
        """Index of the first event after `first` that is not late, or before which SEGMENT_EVENTS are.

        What follows so many may be a clock that was set back all the same, after some disorder.
        """
        late = t_us[first : first + SEGMENT_EVENTS]
        behind = late >= self._latest_before(t_us, first) - MAX_DISORDER_US
        return first + (int(np.argmax(behind)) if behind.any() else late.size)

    def _set_back(self, before: UncheckedEvents, rises: bool, first_us: int) -> Iterator[tuple[UncheckedEvents, bool]]:
        """Hand on or drop the rest of a segment, and begin the next one."""
        if not self._has_begun and len(before) < SEGMENT_EVENTS:
            self._reading.damage.stale_events += len(before)
        else:
            yield from self._hand_on(before, rises)
            self._reading.damage.clock_resets += 1
            self.shift_us += self._latest_us - first_us
        self._has_begun, self._latest_us = False, NO_TIME_US

    def _hand_on(self, events: UncheckedEvents, rises: bool) -> Iterator[tuple[UncheckedEvents, bool]]:
        if not len(events):
            return
        self._has_begun = True
        self._latest_us = max(self._latest_us, int(events.t_us[-1] if rises else events.t_us.max()))
        if self.shift_us:
            events = UncheckedEvents(events.t_us + self.shift_us, *events.columns[1:])
        yield events, rises
