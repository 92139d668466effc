"""Event Stream (.es) of DVS and ATIS cameras."""

from __future__ import annotations

from pathlib import Path

from ...reader import FormatReader, ReadingOptions
from ..registry import FORMATS, RecordingFormat

MAGIC = b"Event Stream"


def _open(path: Path, options: ReadingOptions) -> FormatReader:
    from .reader import EventStreamReader  # loads numba

    return EventStreamReader(path, options)


FORMATS.register(
    RecordingFormat(
        name="event_stream",
        label="Event Stream",
        suffixes=(".es",),
        sniff=lambda path, head: head.startswith(MAGIC),
        open=_open,
    )
)
