"""Summary of a recording from one pass over it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .reader import Progress
from .recording import Recording


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
        Number of hot pixels (see `event_counts`), and their share of the events.
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
    # numba takes 0.3 s to load
    from .event_counts import EVENTS, ON, PEAK_BIN_US, PEAK_EVENTS, EventCounts, count_events, hot_pixel_counts

    counts = EventCounts.of_sensor(recording.width_px, recording.height_px)
    first_us = last_us = None
    for batch in recording.chunks(on_progress=on_progress):  # counting in a thread of its own takes longer
        count_events(counts, *batch.columns)
        first_us, last_us = int(batch.t_us[0]) if first_us is None else first_us, int(batch.t_us[-1])
    duration_us = 0 if first_us is None or last_us is None else last_us - first_us
    events = int(counts.totals[EVENTS])
    hot_pixels, hot_events = hot_pixel_counts(counts.pixels)
    stated = ("path", "format", "width_px", "height_px", "sensor_from", "t_offset_us", "attributes", "warnings")
    return RecordingInfo(
        **{name: getattr(recording, name) for name in stated},
        events=events,
        first_us=first_us,
        last_us=last_us,
        duration_us=duration_us,
        on_share=int(counts.totals[ON]) / events if events else None,
        mean_rate_hz=events / (duration_us * 1e-6) if duration_us else None,
        peak_rate_hz=int(counts.totals[PEAK_EVENTS]) / (PEAK_BIN_US * 1e-6) if events else None,
        hot_pixels=hot_pixels,
        hot_share=hot_events / events if events else 0.0,
        triggers=len(recording.triggers),
        damage=asdict(recording.damage),
    )
