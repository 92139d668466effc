"""Events of the last seconds of a running camera."""

from __future__ import annotations

import threading
from collections import deque

from ..events import EventBatch

KEPT_US = 10_000_000  # longer than any shot until its spin is known
KEPT_EVENTS = 1 << 25  # 436 MB


class RecentEvents:
    """Sink of an `EventStream` that keeps what came last, up to `kept_us` and KEPT_EVENTS."""

    def __init__(self, kept_us: int = KEPT_US) -> None:
        self._kept_us = kept_us
        self._lock = threading.Lock()
        self._kept: deque[tuple[int, EventBatch]] = deque()
        self._events = 0

    def __call__(self, clock: int, events: EventBatch) -> None:
        """Take events; called by the camera's thread."""
        if not len(events):
            return
        with self._lock:
            self._kept.append((clock, events))
            self._events += len(events)
            oldest_us = int(events.t_us[-1]) - self._kept_us
            while self._events > KEPT_EVENTS or (
                self._kept[0][0] == clock and int(self._kept[0][1].t_us[-1]) < oldest_us
            ):
                self._events -= len(self._kept.popleft()[1])

    @property
    def span_us(self) -> tuple[int, int, int] | None:
        """Number of the newest clock, and [start, end) of the events that are kept by it; None without any."""
        with self._lock:
            if not self._kept:
                return None
            clock, newest = self._kept[-1]
            oldest = next(events for number, events in self._kept if number == clock)
        return clock, int(oldest.t_us[0]), int(newest.t_us[-1]) + 1

    def between(self, clock: int, start_us: int, end_us: int) -> EventBatch:
        """The events of [start_us, end_us) by a clock, as far as they are kept."""
        with self._lock:
            kept = [events for number, events in self._kept if number == clock]
        return EventBatch.concatenate(part for events in kept if len(part := events.between(start_us, end_us)))
