"""A recording's events as the source of a chain: in memory, or read from disk on demand."""

from __future__ import annotations

from pathlib import Path

from ..errors import RecordingError
from ..event_source import EventsInMemory
from ..events import EventBatch
from .in_memory import RecordingInMemory
from .reader import Progress
from .recording import Recording
from .streamed import RecordingPieces, StreamedEvents, events_of

AnyRecording = Recording | RecordingInMemory
RecordedEvents = EventsInMemory | StreamedEvents


def recorded_events(
    recording: AnyRecording, window_us: tuple[int, int] | None = None, on_progress: Progress | None = None
) -> RecordedEvents:
    """Read the events of a window, or index a recording that is too long for memory.

    Parameters
    ----------
    window_us : (int, int), optional
        [start, end) in file time; all of the recording without it.
    on_progress : callable, optional
        Called with the share done, 0..1.

    Raises
    ------
    RecordingError
        The recording cannot be read, or the window holds no events.
    """
    start_us, end_us = window_us or (None, None)
    if isinstance(recording, RecordingInMemory):
        events: EventBatch | RecordingPieces = recording.read(start_us, end_us)
    else:
        events = events_of(recording, start_us, end_us, on_progress)
    size_px = recording.width_px, recording.height_px
    if isinstance(events, RecordingPieces):
        window_us = window_us or (events.index.first_us, events.index.last_us + 1)
        return StreamedEvents((recording.identity(), window_us), events, *size_px, *window_us)
    if not len(events):
        raise RecordingError(_no_events(window_us, recording.path))
    window_us = window_us or (int(events.t_us[0]), int(events.t_us[-1]) + 1)
    return EventsInMemory((recording.identity(), window_us), events, *size_px, *window_us)


def _no_events(window_us: tuple[int, int] | None, path: Path) -> str:
    if window_us:
        return (
            f"there are no events from {window_us[0]} to {window_us[1]} us: "
            f"`spinscope info` shows the recording's own times: {path}"
        )
    return f"the recording holds no events: {path}"
