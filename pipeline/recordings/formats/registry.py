"""Registry of recording formats."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from ...errors import RecordingError
from ...events import EventBatch
from ...extensions import Registry
from ...results import Truth
from ..reader import FormatReader, ReadingOptions, Triggers


@dataclass(frozen=True, kw_only=True)
class RecordingContent:
    """Events and all that goes with them, for a format to write.

    Attributes
    ----------
    path : Path
        File as messages name it; what is written has a temporary name.
    batches : iterable of EventBatch
        Events in order of time and on the sensor, to be iterated once.
    attributes : mapping of str to str or float
        Statements about camera and scene, without those about the encoding of another file.
    triggers : callable returning Triggers
        Edges of the trigger input. Called before the batches are read, it costs another pass over the source.
    truth : callable returning Truth or None
        Simulator's truth, to be called after the batches were read: None if its labels do not fit the events.
    t_offset_us : int or None
        Offset of the file's time in DSEC recordings.
    encoding : str
        One of the format's `encodings`; empty where it has none.
    """

    path: Path
    batches: Iterable[EventBatch]
    width_px: int
    height_px: int
    attributes: Mapping[str, str | float]
    triggers: Callable[[], Triggers]
    truth: Callable[[], Truth | None]
    t_offset_us: int | None
    encoding: str = ""


@dataclass(frozen=True, kw_only=True)
class RecordingFormat:
    """One format of recordings on disk.

    Attributes
    ----------
    label : str
        Name for people.
    suffixes : tuple of str
        Suffixes of its files in lower case, the usual one first; they choose the format for writing only.
    sniff : callable
        `sniff(path, head)` tells from the first `HEAD_BYTES` bytes, or from the file, whether it is of this format.
    open : callable
        `open(path, options)` returns the reader of a file; raises RecordingError when it cannot be read.
    write : callable or None
        `write(path, content)` writes a new file; raises OSError or RecordingError. None for a format only read.
    isolated : bool
        Whether files are opened and read in a process with limits: for those read through a foreign library. The reader
        has to be picklable before and after a pass, and `open` a function of a module.
    keeps : frozenset of str
        What written files hold beside the events: of "sensor", "attributes", "triggers", "truth" and "t_offset".
    encodings : tuple of str
        Those among which a writer can be asked to choose, the usual one first.
    generic : bool
        Whether other kinds of files look alike and have these suffixes, too: the format is asked last, and in a folder
        the content tells.
    """

    name: str
    label: str
    suffixes: tuple[str, ...]
    sniff: Callable[[Path, bytes], bool]
    open: Callable[[Path, ReadingOptions], FormatReader]
    write: Callable[[Path, RecordingContent], None] | None = None
    isolated: bool = False
    keeps: frozenset[str] = frozenset({"sensor"})
    encodings: tuple[str, ...] = ()
    generic: bool = False

    @property
    def listed(self) -> str:
        """Label and suffixes for messages: "HDF5 (.h5, .hdf5)"."""
        return f"{self.label} ({', '.join(self.suffixes)})"


HEAD_BYTES = 4096
FORMATS: Registry[RecordingFormat] = Registry("recording format")


def head_of(path: Path) -> bytes:
    """First HEAD_BYTES bytes of a file; raises OSError."""
    with open(path, "rb") as file:
        return file.read(HEAD_BYTES)


def is_recording(path: Path) -> bool:
    """Whether a file in a folder is taken as a recording: by its suffix, and by its content where that is shared."""
    suffix = path.suffix.lower()
    for format in FORMATS:
        if suffix in format.suffixes and path.is_file():
            try:
                return not format.generic or format.sniff(path, head_of(path))
            except OSError:
                return True  # its reader says what is wrong
    return False


def readable_suffixes() -> tuple[str, ...]:
    """Suffixes of all formats, in lower case with the dot."""
    return tuple(suffix for format in FORMATS for suffix in format.suffixes)


def writable_suffixes() -> tuple[str, ...]:
    """Suffixes of the formats that can be written."""
    return tuple(suffix for format in FORMATS if format.write for suffix in format.suffixes)


def encoding_to_write(path: Path, asked: str | None) -> str:
    """Encoding for a file to be written, `asked` or the usual one; raises RecordingError for one there is not."""
    format = format_to_write(path)
    known = [*format.encodings, ""]
    if asked is None:
        return known[0]
    for encoding in format.encodings:
        if encoding.lower() == asked.lower():
            return encoding
    there = f"one of {', '.join(format.encodings)}" if format.encodings else "none, it has one encoding only"
    raise RecordingError(f"{format.label} is not written in the encoding {asked!r}: give {there}: {path}")


def format_to_write(path: Path) -> RecordingFormat:
    """Format of the path's suffix; raises RecordingError unless there is one and it can be written."""
    suffix = path.suffix.lower()
    for format in FORMATS:
        if suffix in format.suffixes and format.write is not None:
            return format
    known = ", ".join(writable_suffixes())
    raise RecordingError(f"suffix {suffix!r} is no format that can be written: give another, one of {known}: {path}")
