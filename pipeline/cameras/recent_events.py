"""Events of the last seconds of a running camera."""

from __future__ import annotations

import threading
from collections import deque
from typing import NamedTuple

from ..events import EventBatch

KEPT_US = 10_000_000  # longer than any shot until its spin is known
KEPT_EVENTS = 1 << 25  # 436 MB


class _Kept(NamedTuple):
    clock: int
    events: EventBatch
    first_us: int
    last_us: int
    passed_us: int  # time of the last event, counted on over all clocks


class RecentEvents:
    """Sink of an `EventStream` that keeps what came last, up to KEPT_EVENTS.

    Parameters
    ----------
    kept_us : int
        Length of what is kept in any case, and of what is kept before the events that are needed.
    """

    def __init__(self, kept_us: int = KEPT_US) -> None:
        self._kept_us = kept_us
        self._lock = threading.Lock()
        self._kept: deque[_Kept] = deque()
        self._events = 0
        self._clock, self._shift_us, self._passed_us = 0, 0, 0
        self._needed: tuple[int, int] | None = None

    def __call__(self, clock: int, events: EventBatch) -> None:
        """Take events; called by the camera's thread."""
        if not len(events):
            return
        first_us, last_us = int(events.t_us[0]), int(events.t_us[-1])
        with self._lock:
            if clock != self._clock:
                self._clock, self._shift_us = clock, self._passed_us - first_us
            self._passed_us = last_us + self._shift_us
            self._kept.append(_Kept(clock, events, first_us, last_us, self._passed_us))
            self._events += len(events)
            while self._events > KEPT_EVENTS or self._is_past(self._kept[0]):
                self._events -= len(self._kept.popleft().events)

    def keep_from(self, clock: int, start_us: int) -> None:
        """Keep events from a time on, which somebody needs who is behind; until the next call."""
        self._needed = clock, start_us - self._kept_us

    def _is_past(self, one: _Kept) -> bool:
        if one.passed_us >= self._passed_us - self._kept_us:
            return False
        return self._needed is None or (one.clock, one.last_us) < self._needed

    @property
    def span_us(self) -> tuple[int, int, int] | None:
        """Number of the newest clock, and [start, end) of the events that are kept by it; None without any."""
        with self._lock:
            if not self._kept:
                return None
            newest = self._kept[-1]
            oldest = next(one for one in self._kept if one.clock == newest.clock)
        return newest.clock, oldest.first_us, newest.last_us + 1

    def between(self, clock: int, start_us: int, end_us: int) -> EventBatch:
        """The events of [start_us, end_us) by a clock, as far as they are kept."""
        with self._lock:  # many thousands are kept, few of which are cut
            of_clock = (one for one in self._kept if one.clock == clock)
            kept = [one for one in of_clock if one.first_us < end_us and one.last_us >= start_us]
        return EventBatch.concatenate(part for one in kept if len(part := one.events.between(start_us, end_us)))
