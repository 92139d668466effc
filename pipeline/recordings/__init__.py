"""Recordings on disk: open, read in streams, summarise, write, convert.

Nothing else of this package is meant to be imported from outside.
"""

from .formats.registry import (
    FORMATS,
    RecordingContent,
    RecordingFormat,
    format_to_write,
    readable_suffixes,
    writable_suffixes,
)
from .opening import open_recording
from .reader import Damage, FormatReader, ReadPass, Triggers, UncheckedEvents
from .recording import Recording
from .summary import RecordingInfo, summary
from .writing import convert, write_recording

__all__ = [
    "FORMATS",
    "Damage",
    "FormatReader",
    "ReadPass",
    "Recording",
    "RecordingContent",
    "RecordingFormat",
    "RecordingInfo",
    "Triggers",
    "UncheckedEvents",
    "convert",
    "format_to_write",
    "open_recording",
    "readable_suffixes",
    "summary",
    "writable_suffixes",
    "write_recording",
]
