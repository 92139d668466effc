"""Events of the last seconds of a running camera."""

from __future__ import annotations

import threading
from collections import deque

from ..events import EventBatch

KEPT_US = 10_000_000  # longer than any shot until its spin is known
KEPT_EVENTS = 1 << 24  # 218 MB


class RecentEvents:
    """Sink of an `EventStream` that keeps what came last, up to KEPT_US and KEPT_EVENTS."""

    def __init__(self) -> None:
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
            oldest_us = int(events.t_us[-1]) - KEPT_US
            while self._events > KEPT_EVENTS or (
                self._kept[0][0] == clock and int(self._kept[0][1].t_us[-1]) < oldest_us
            ):
                self._events -= len(self._kept.popleft()[1])

    def between(self, clock: int, start_us: int, end_us: int) -> EventBatch:
        """The events of [start_us, end_us) by a clock, as far as they are kept."""
        with self._lock:
            kept = [events for number, events in self._kept if number == clock]
        return EventBatch.concatenate(part for events in kept if len(part := events.between(start_us, end_us)))
