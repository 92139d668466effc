"""Recordings on disk: open, read in streams, look over, write, convert.

Nothing else of this package is meant to be imported from outside.
"""

from .converting import convert
from .opening import open_recording
from .recording import Recording
from .source import Damage, Triggers
from .summary import RecordingInfo, summary
from .writing import write_npz, write_raw, write_recording

__all__ = [
    "Damage",
    "Recording",
    "RecordingInfo",
    "Triggers",
    "convert",
    "open_recording",
    "summary",
    "write_npz",
    "write_raw",
    "write_recording",
]
