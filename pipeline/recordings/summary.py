"""Summary of a recording from one pass over it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..events import EventBatch
from .reader import Progress
from .recording import Recording

PEAK_BIN_US = 1000  # the peak rate is that of the fullest millisecond
# A hot pixel has 10 events or more, and over 10 times as many as the second busiest of its 8 neighbours: a
# line in the scene that keeps firing has two busy neighbours along it. Against the truth of ten simulated
# recordings: all pixels found are hot, and they hold 90 % or more of the hot pixels' events.
HOT_EVENTS = 10
HOT_RATIO = 10
HOT_NEIGHBOUR = 2


@dataclass(frozen=True, slots=True)
class RecordingInfo:
    """Result of `summary`; None where there are no events, or no duration, to tell it from.

    Attributes
    ----------
    path, format, width_px, height_px, sensor_from, attributes, t_offset_us, warnings
        As of `Recording`.
    duration_us : int
        Last time less first, 0 without events.
    mean_rate_hz, peak_rate_hz : float or None
        Events a second over the duration, and in the fullest millisecond.
    hot_pixels, hot_share : int, float
        Number of hot pixels (see HOT_EVENTS), and their share of the events.
    triggers : int
        Number of edges on the trigger input.
    damage : dict of str to int
        Count of every kind of damage, see `Damage`.
    """

    path: Path
    format: str
    width_px: int
    height_px: int
    sensor_from: str
    events: int
    first_us: int | None
    last_us: int | None
    duration_us: int
    on_share: float | None
    mean_rate_hz: float | None
    peak_rate_hz: float | None
    hot_pixels: int
    hot_share: float
    triggers: int
    damage: dict[str, int]
    t_offset_us: int | None
    attributes: dict[str, str | float]
    warnings: list[str]

    def as_dict(self) -> dict[str, Any]:
        """Names and values ready for JSON; the sensor's size as `width` and `height`."""
        values = {name.removesuffix("_px"): getattr(self, name) for name in self.__slots__}
        return {**values, "path": str(self.path)}


def summary(recording: Recording, on_progress: Progress | None = None) -> RecordingInfo:
    """Summarise a recording in one pass, in constant memory; raises RecordingError if it cannot be read."""
    statistics = _EventStatistics(recording.width_px, recording.height_px)
    for batch in recording.chunks(on_progress=on_progress):
        statistics.add(batch)
    first_us, last_us = statistics.first_us, statistics.last_us
    duration_us = 0 if first_us is None or last_us is None else last_us - first_us
    hot_pixels, hot_events = statistics.hot()
    events = statistics.events
    stated = ("path", "format", "width_px", "height_px", "sensor_from", "t_offset_us", "attributes", "warnings")
    return RecordingInfo(
        **{name: getattr(recording, name) for name in stated},
        events=events,
        first_us=first_us,
        last_us=last_us,
        duration_us=duration_us,
        on_share=statistics.on / events if events else None,
        mean_rate_hz=events / (duration_us * 1e-6) if duration_us else None,
        peak_rate_hz=statistics.peak_events / (PEAK_BIN_US * 1e-6) if events else None,
        hot_pixels=hot_pixels,
        hot_share=hot_events / events if events else 0.0,
        triggers=len(recording.triggers),
        damage=asdict(recording.damage),
    )


class _EventStatistics:
    """Counts over successive batches."""

    def __init__(self, width_px: int, height_px: int) -> None:
        self._width_px = width_px
        self._counts: NDArray[np.int64] = np.zeros((height_px, width_px), np.int64)
        self.events = self.on = self.peak_events = 0
        self.first_us: int | None = None
        self.last_us: int | None = None
        self._bin, self._bin_events = 0, 0  # the last, perhaps unfinished millisecond

    def add(self, batch: EventBatch) -> None:
        """Count the events of a batch that is not empty."""
        if self.first_us is None:
            self.first_us = int(batch.t_us[0])
        self.last_us = int(batch.t_us[-1])
        self.events += len(batch)
        self.on += int(np.count_nonzero(batch.on))
        pixels = batch.y_px.astype(np.intp) * self._width_px + batch.x_px
        self._counts += np.bincount(pixels, minlength=self._counts.size).reshape(self._counts.shape)
        bins = batch.t_us // PEAK_BIN_US
        starts = np.flatnonzero(np.diff(bins, prepend=bins[0] - 1))
        counts = np.diff(starts, append=bins.size)
        if self._bin == bins[0]:
            counts[0] += self._bin_events
        self.peak_events = max(self.peak_events, int(counts.max()))
        self._bin, self._bin_events = int(bins[-1]), int(counts[-1])

    def hot(self) -> tuple[int, int]:
        """Count the hot pixels, and their events."""
        rows, columns = np.nonzero(self._counts >= HOT_EVENTS)
        padded = np.pad(self._counts, 1)
        around = np.stack([padded[rows + dy, columns + dx] for dy in range(3) for dx in range(3) if (dy, dx) != (1, 1)])
        neighbour = np.sort(around, axis=0)[-HOT_NEIGHBOUR]
        events = self._counts[rows, columns]
        hot = events > HOT_RATIO * neighbour
        return int(np.count_nonzero(hot)), int(events[hot].sum())
