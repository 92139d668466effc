"""Sorting of a stream of events by time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from ..errors import RecordingError
from .reader import MAX_DISORDER_US, ReadPass, UncheckedEvents

NO_TIME_US = -(2**63)  # before all times


class TimeOrder:
    """Stable sort of a stream of events by time.

    An event may come up to 10 ms behind the latest one before it (readout of several event buffers, a wrong
    time word): so the last 10 ms are held back until more has come. Events further behind are refused
    (RecordingError) if `strict`, and dropped and counted in `reading` otherwise, because earlier events are handed on.

    Attributes
    ----------
    latest_us : int
        Latest time of all events so far, those before the pass among them.
    """

    def __init__(self, path: Path, reading: ReadPass, strict: bool, latest_us: int = NO_TIME_US) -> None:
        self._path, self._reading, self._strict = path, reading, strict
        self._events = 0  # pushed so far
        self._held: list[UncheckedEvents] = []
        self._held_in_order = True
        self._first_us = 2**63 - 1  # of those held
        self.latest_us = latest_us
        self._before_us = NO_TIME_US  # of the event just before, in file order

    def sorted(self, parts: Iterable[tuple[UncheckedEvents, bool]]) -> Iterator[UncheckedEvents]:
        """Yield the events of all parts in order of time, in parts that are not empty.

        parts: with whether they are known to be in order, see `ClockSegments.joined`.
        """
        for part, rises in parts:
            yield from self._push(part, rises)
        yield from self._ordered()

    def _push(self, new: UncheckedEvents, rises: bool) -> Iterator[UncheckedEvents]:
        """Take the next events; yields those that no later event can precede."""
        t_us = new.t_us
        backward = 0 if rises else int(np.count_nonzero(t_us[1:] < t_us[:-1]))
        backward += int(t_us[0]) < self._before_us
        in_order = not backward and int(t_us[0]) >= self.latest_us
        if not in_order:
            new = self._without_late(new)
        self._reading.damage.backward_steps += backward
        self._before_us = int(t_us[-1])
        self.latest_us = int(t_us[-1]) if in_order else max(self.latest_us, int(t_us.max()))
        self._events += t_us.size
        if len(new):
            self._held.append(new)
            self._held_in_order &= in_order
            self._first_us = min(self._first_us, int(t_us[0]) if in_order else int(new.t_us.min()))
        sure_us = self.latest_us - MAX_DISORDER_US
        if self._first_us > sure_us:
            return
        known, self._held, self._held_in_order = self._ordered(), [], True
        for part in known:
            sure = int(np.searchsorted(part.t_us, sure_us, side="right"))
            if sure < len(part):
                self._held.append(part[sure:])
            if sure:
                yield part[:sure]
        self._first_us = int(self._held[0].t_us[0]) if self._held else 2**63 - 1

    def _ordered(self) -> list[UncheckedEvents]:
        """The events held back, in parts in order of time."""
        if self._held_in_order:
            return self._held
        known = UncheckedEvents.concatenate(self._held)
        return [known[np.argsort(known.t_us, kind="stable")]]

    def _without_late(self, new: UncheckedEvents) -> UncheckedEvents:
        latest_us = np.maximum(np.maximum.accumulate(new.t_us), self.latest_us)
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
