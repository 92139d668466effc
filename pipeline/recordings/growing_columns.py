"""Columns of all events that a pass reads, in one piece of memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..events import EventBatch


class DecodedColumns(NamedTuple):
    """Columns (n,) that a decoder fills from their start."""

    t_us: NDArray[np.int64]
    x_px: NDArray[np.uint16]
    y_px: NDArray[np.uint16]
    on: NDArray[np.bool_]

    @classmethod
    def empty(cls, events: int) -> DecodedColumns:
        """Room for so many events."""
        t_us, x_px, y_px, on = (np.empty(events, kind) for kind in EventBatch.KINDS)
        return cls(t_us, x_px, y_px, on)

    def rows(self, first: int, upto: int) -> DecodedColumns:
        """Views of the rows [first, upto)."""
        rows = slice(first, upto)
        return DecodedColumns(self.t_us[rows], self.x_px[rows], self.y_px[rows], self.on[rows])


class GrowingColumns:
    """Columns that events are appended to in order, and that readers decode into before.

    An event that is neither dropped nor put in order is decoded at its place in the end, and costs no copy. Before it
    there is room for all events decoded before it: appended ones never reach those that are still to be appended.

    Attributes
    ----------
    events : int
        Number of events appended.
    """

    def __init__(self, room: int) -> None:
        self.events = 0
        self._decoded = 0
        self._columns = DecodedColumns.empty(room)

    def room(self, events: int) -> DecodedColumns:
        """Columns to decode the next events into, up to so many."""
        self._grow(self._decoded + events)
        return self._columns.rows(self._decoded, self._decoded + events)

    def note_decoded(self, events: int) -> None:
        """Note how many events were decoded into the room given last."""
        self._decoded += events

    def append(self, batch: EventBatch) -> None:
        """Add events, wherever they are."""
        first, self.events = self.events, self.events + len(batch)
        self._grow(self.events)
        for place, values in _pairs(self._columns.rows(first, self.events), batch.columns):
            if _address(place) != _address(values):
                place[:] = values

    def batch(self) -> EventBatch:
        """The events appended so far."""
        return EventBatch(*self._columns.rows(0, self.events))

    def _grow(self, events: int) -> None:
        """Make room for so many events in all; parts that are still to be appended keep the memory they are in."""
        room = self._columns.t_us.size
        if events <= room:
            return
        larger = DecodedColumns.empty(max(2 * room, events))
        appended = min(self.events, room)
        for new, old in _pairs(larger, self._columns):
            new[:appended] = old[:appended]
        self._columns = larger


def _pairs(some: Sequence[NDArray[Any]], others: Sequence[NDArray[Any]]) -> Iterator[tuple[NDArray[Any], NDArray[Any]]]:
    """The columns of the same name."""
    return zip(some, others, strict=True)


def _address(column: NDArray[Any]) -> int:
    return int(column.__array_interface__["data"][0])
