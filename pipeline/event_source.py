"""Origins of events: what the chain asks of a recording, a camera or a simulation."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .events import EventBatch


class EventSource(Protocol):
    """Origin of events: a recording, a camera or a simulation."""

    @property
    def identity(self) -> Hashable:
        """Identity of the source by content: no other has an equal one."""

    @property
    def width_px(self) -> int:
        """Width of the sensor."""

    @property
    def height_px(self) -> int:
        """Height of the sensor."""

    @property
    def start_us(self) -> int:
        """Time from which events exist (file time)."""

    @property
    def end_us(self) -> int:
        """Time up to which all events are known (file time, exclusive); grows while a camera is running."""

    @property
    def growing(self) -> bool:
        """Whether events may still come; then only whole ticks are run."""

    def between(self, start_us: int, end_us: int) -> EventBatch:
        """The events of [start_us, end_us). Asked for in rising order when `run` forgets packets."""


@dataclass(frozen=True)
class EventsInMemory:
    """Source whose events are all in memory."""

    identity: Hashable
    events: EventBatch
    width_px: int
    height_px: int
    start_us: int
    end_us: int
    growing: bool = False

    def between(self, start_us: int, end_us: int) -> EventBatch:
        """The events of [start_us, end_us)."""
        return self.events.between(max(start_us, self.start_us), min(end_us, self.end_us))

    @property
    def event_count(self) -> int:
        """Number of events."""
        return len(self.events)

    def rate(self, edges_us: NDArray[np.int64]) -> NDArray[np.int64]:
        """(n,) int64 numbers of events between n + 1 times."""
        return np.diff(np.searchsorted(self.events.t_us, edges_us))

    def part(self, identity: Hashable, start_us: int, end_us: int) -> EventsInMemory:
        """The events of [start_us, end_us) as a source of its own."""
        return replace(self, identity=identity, events=self.between(start_us, end_us), start_us=start_us, end_us=end_us)
