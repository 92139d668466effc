"""Sorting of a stream of events by time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from ..errors import RecordingError
from .reader import MAX_DISORDER_US, ReadPass, UncheckedEvents


class TimeOrder:
    """Stable sort of a stream of events by time.

    An event may come up to 10 ms behind the latest one before it (readout of several event buffers, a wrong
    time word): so the last 10 ms are held back until more has come. Events further behind are refused
    (RecordingError) if `strict`, and dropped and counted in `reading` otherwise, because earlier events are handed on.
    """

    def __init__(self, path: Path, reading: ReadPass, strict: bool) -> None:
        self._path, self._reading, self._strict = path, reading, strict
        self._events = 0  # pushed so far
        self._held: list[UncheckedEvents] = []
        self._held_in_order = True
        self._first_us = 2**63 - 1  # of those held
        self._latest_us = -(2**63)  # of all events so far
        self._before_us = -(2**63)  # of the event just before, in file order

    def sorted(self, parts: Iterable[UncheckedEvents]) -> Iterator[UncheckedEvents]:
        """Yield the events of all parts in order of time, in parts that are not empty."""
        for part in parts:
            if sure := self._push(part):
                yield sure
        if any(map(len, self._held)):
            yield self._joined()

    def _push(self, new: UncheckedEvents) -> UncheckedEvents | None:
        """Take the next events; returns those that no later event can precede, None when there are none."""
        t_us = new.t_us
        backward = int(np.count_nonzero(t_us[1:] < t_us[:-1])) + (int(t_us[0]) < self._before_us)
        in_order = not backward and int(t_us[0]) >= self._latest_us
        if not in_order:
            new = self._without_late(new)
        self._reading.damage.backward_steps += backward
        self._before_us = int(t_us[-1])
        self._latest_us = int(t_us[-1]) if in_order else max(self._latest_us, int(t_us.max()))
        self._events += t_us.size
        if len(new):
            self._held.append(new)
            self._held_in_order &= in_order
            self._first_us = min(self._first_us, int(new.t_us.min()))
        if self._first_us > self._latest_us - MAX_DISORDER_US:
            return None
        known = self._joined()
        sure = int(np.searchsorted(known.t_us, self._latest_us - MAX_DISORDER_US, side="right"))
        self._held, self._held_in_order = [known[sure:]], True
        self._first_us = int(known.t_us[sure]) if sure < len(known) else 2**63 - 1
        return known[:sure]

    def _joined(self) -> UncheckedEvents:
        """The events held back, in order of time."""
        known = UncheckedEvents.concatenate(self._held)
        return known if self._held_in_order else known[np.argsort(known.t_us, kind="stable")]

    def _without_late(self, new: UncheckedEvents) -> UncheckedEvents:
        latest_us = np.maximum(np.maximum.accumulate(new.t_us), self._latest_us)
        late = new.t_us < latest_us - MAX_DISORDER_US
        if not late.any():
            return new
        if self._strict:
            at = int(np.argmax(late))
            raise RecordingError(
                f"time goes backwards at event {self._reading.first_row + self._events + at}: {latest_us[at]} us, "
                f"then {new.t_us[at]} us (up to {MAX_DISORDER_US} us is put in order): sort the recording by time "
                f"or split it there: {self._path}"
            )
        self._reading.damage.late_events += int(np.count_nonzero(late))
        return new[~late]
