"""Events back into the order of time, in a stream."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import RecordingError
from .source import MAX_DISORDER_US, Columns, Damage


class TimeOrder:
    """Sorts a stream of events by time, equal times staying in file order.

    An event may come up to 10 ms after one that is later (readout of several event buffers, a wrong time word):
    so the last 10 ms are held back until more has come. Events further behind the latest time so far are refused
    (RecordingError) where order is law, and dropped and counted otherwise: nothing that was already handed on can
    be put right any more.
    """

    def __init__(self, path: Path, damage: Damage, order_is_law: bool, first_row: int = 0) -> None:
        self._path, self._damage, self._law, self._row = path, damage, order_is_law, first_row
        self._held: Columns | None = None
        self._held_sorted = True
        self._latest_us: int | None = None  # of all events so far
        self._before_us: int | None = None  # time of the event just before, in file order

    def push(self, new: Columns) -> list[Columns]:
        """The events that are now sure to be in order, at most two pieces."""
        if not len(new):
            return []
        t_us = new.t_us
        backward = int(np.count_nonzero(t_us[1:] < t_us[:-1]))
        backward += self._before_us is not None and int(t_us[0]) < self._before_us
        self._before_us = int(t_us[-1])
        self._damage.backward_steps += backward
        if backward:
            new = self._without_late(new)
        self._row += t_us.size
        if not len(new):
            return []
        latest = max(int(new.t_us.max()), self._latest_us if self._latest_us is not None else -(2**63))
        self._latest_us = latest
        ready: list[Columns] = []
        if self._held is not None and (backward or not self._held_sorted):
            new = self._held.then(new)
        elif self._held is not None:
            ready.append(self._held)
        if backward:
            new = new[np.argsort(new.t_us, kind="stable")]
        sure = int(np.searchsorted(new.t_us, latest - MAX_DISORDER_US, side="right"))
        # Held events before `new` are handed on now, though the next block may still bring one that is up to 10 ms
        # earlier than `latest`: only those older than that are.
        if ready:
            held = ready.pop()
            cut = int(np.searchsorted(held.t_us, latest - MAX_DISORDER_US, side="right"))
            ready = [held[:cut]] if cut else []
            if cut < len(held):
                new, sure = held[cut:].then(new), 0 if not sure else sure + len(held) - cut
        self._held = new[sure:] if sure < len(new) else None
        if sure:
            ready.append(new[:sure])
        return ready

    def finish(self) -> list[Columns]:
        """What was held back."""
        held, self._held = self._held, None
        return [] if held is None else [held]

    def _without_late(self, new: Columns) -> Columns:
        first = new.t_us[0] if self._latest_us is None else max(self._latest_us, int(new.t_us[0]))
        latest = np.maximum(np.maximum.accumulate(new.t_us), first)
        late = latest - new.t_us > MAX_DISORDER_US
        if not late.any():
            return new
        if self._law:
            at = int(np.argmax(late))
            raise RecordingError(
                f"time goes backwards at event {self._row + at}: {int(latest[at])} us, then {int(new.t_us[at])} us; "
                f"more than {MAX_DISORDER_US // 1000} ms is no jitter: sort the recording by time, or split it there: "
                f"{self._path}"
            )
        self._damage.late_events += int(np.count_nonzero(late))
        return new[~late]
