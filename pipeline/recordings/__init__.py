"""Recordings on disk: open, read in streams, summarise, write, convert.

Nothing else of this package is meant to be imported from outside, but for the writer of a running camera's events: it
loads numba, which takes as long as all the rest, and processes that read for others do without it.
"""

from .formats.registry import FORMATS as FORMATS
from .formats.registry import RecordingContent as RecordingContent
from .formats.registry import RecordingFormat as RecordingFormat
from .formats.registry import format_to_write as format_to_write
from .formats.registry import is_recording as is_recording
from .formats.registry import readable_suffixes as readable_suffixes
from .formats.registry import writable_suffixes as writable_suffixes
from .opening import open_recording as open_recording
from .reader import CameraFrame as CameraFrame
from .reader import FormatReader as FormatReader
from .reader import ReadingOptions as ReadingOptions
from .reader import ReadPass as ReadPass
from .reader import Triggers as Triggers
from .reader import UncheckedEvents as UncheckedEvents
from .recording import Recording as Recording
from .summary import RecordingInfo as RecordingInfo
from .summary import summary as summary
from .time_units import TIME_UNITS as TIME_UNITS
from .writing import convert as convert
from .writing import write_recording as write_recording
