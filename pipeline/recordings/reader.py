"""Interface between the readers of the formats and `Recording`, and the counts of one pass over a file."""

from __future__ import annotations

import struct
import tokenize
import zipfile
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..events import ColumnBatch
from ..results import Truth
from .growing_columns import DecodedColumns, GrowingColumns
from .sensor import Resolution

Progress = Callable[[float], None]  # called with the share done, 0 to 1

CHUNK_EVENTS = 1 << 17  # events handed on at once: 1.7 MB, which the processor's caches hold
LAST_US = 1 << 62  # times beyond it, or before its negative, are broken: leaves room to add and subtract
MAX_DISORDER_US = 10_000  # events up to this far behind an earlier one are put in order; see `order.py`

# Whatever the libraries below throw at damaged files; none of it may reach the user as a traceback.
FILE_ERRORS = (
    *(OSError, RuntimeError, KeyError, ValueError, TypeError, MemoryError, OverflowError, NotImplementedError),
    *(AttributeError, IndexError, EOFError, SystemError, zlib.error, zipfile.BadZipFile, struct.error),
    *(SyntaxError, tokenize.TokenError),  # of the headers of NumPy's arrays
)


def _count(sentence: str) -> int:
    """Field of `Damage` with its sentence for people."""
    count: int = field(default=0, metadata={"sentence": sentence})
    return count


@dataclass(slots=True)
class Damage:
    """Counts of everything wrong that a full pass over a recording found; all zero in a sound file."""

    bad_words: int = _count("{} words of no known type were skipped")
    broken_events: int = _count("{} events with a value that is no time, pixel or polarity were dropped")
    backward_steps: int = _count("time steps backwards {} times; events up to 10 ms late were put in order")
    # Of these; only in RAW files, others are refused.
    late_events: int = _count("{} events more than 10 ms behind earlier ones were dropped")
    stale_events: int = _count("{} events of an earlier time, before the camera's clock started, were dropped")
    clock_resets: int = _count(
        "the camera's clock was set back {} times: the events after it were put behind those before it, without a gap"
    )
    time_jumps: int = _count("{} times that those after them contradict were ignored")
    untimed_events: int = _count("{} events without a sure time or row were dropped")
    outside_events: int = _count("{} events outside the sensor were dropped")
    lost_bytes: int = _count("{} bytes at the end make no whole word: the file was cut")
    broken_ends: int = _count("the file is damaged or cut at {} place, and nothing behind it could be read")

    def sentences(self) -> list[str]:
        """One sentence for people for every kind that occurred."""
        counts = ((kind, getattr(self, kind.name)) for kind in fields(self))
        return [kind.metadata["sentence"].format(count) for kind, count in counts if count]


@dataclass(frozen=True, slots=True, eq=False)
class Triggers(ColumnBatch):
    """Edges on the camera's trigger input.

    Attributes
    ----------
    value, id : (n,) uint8
        1 for a rising edge, 0 for a falling one; number of the input.
    """

    KINDS: ClassVar = ("i8", "u1", "u1")
    t_us: NDArray[np.int64]
    value: NDArray[np.uint8]
    id: NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class UncheckedEvents(ColumnBatch):
    """Events (n,) as they are in a file: not yet in order of time (within LAST_US), perhaps outside the sensor."""

    KINDS: ClassVar = ("i8", "i8", "i8", "?")
    t_us: NDArray[np.int64]
    x: NDArray[Any]
    y: NDArray[Any]
    on: NDArray[np.bool_]


class Place(NamedTuple):
    """Place between two events of a file, from which a reader can go on as if it had read all before.

    Attributes
    ----------
    offset : int
        Bytes or rows of the file before it.
    state : tuple of int
        State of the format's decoder there; always as long in one format.
    """

    offset: int
    state: tuple[int, ...] = ()


class CameraFrame(NamedTuple):
    """Picture that a camera took besides the events.

    Attributes
    ----------
    t_us : int
        Middle of its exposure, the file's time.
    x_px, y_px : int
        Place of its first pixel on the sensor.
    pixels : (h, w) or (h, w, 3) uint8
        Grey values, or red, green and blue.
    """

    t_us: int
    x_px: int
    y_px: int
    pixels: NDArray[np.uint8]


@dataclass(slots=True)
class ReadPass:
    """One pass over a file: the request, and what the reader found so far.

    Attributes
    ----------
    max_events : int
        Most events that a reader hands over at once.
    start_us, end_us : int or None
        A reader may leave out events that lie surely outside [start_us, end_us).
    place : Place or None
        Where the reader begins, None for the start of the file; then, whenever it hands over events, where it would go
        on behind them, if it `seeks`.
    first_row : int
        Number of the first event that the reader gave.
    triggers : list of Triggers
        Edges found so far.
    columns : GrowingColumns or None
        Memory for all events of the pass, where they are to be held.
    """

    max_events: int = CHUNK_EVENTS
    start_us: int | None = None
    end_us: int | None = None
    on_progress: Progress | None = None
    place: Place | None = None
    first_row: int = 0
    damage: Damage = field(default_factory=Damage)
    triggers: list[Triggers] = field(default_factory=list)
    columns: GrowingColumns | None = None

    def room(self, events: int) -> DecodedColumns:
        """Columns to decode the next events into, up to so many."""
        return DecodedColumns.empty(events) if self.columns is None else self.columns.room(events)

    def decoded(self, room: DecodedColumns, events: int) -> UncheckedEvents:
        """The first events of the room given last, which have been decoded into it."""
        if self.columns is not None:
            self.columns.note_decoded(events)
        return UncheckedEvents(*room.rows(0, events))

    def report(self, done: float, total: float) -> None:
        """Tell the share done."""
        if self.on_progress is not None:
            self.on_progress(min(done / total, 1.0) if total else 1.0)

    def is_past(self, t_us: int) -> bool:
        """Whether all events behind one of this time lie after the end, however disordered the file is."""
        return self.end_us is not None and t_us >= self.end_us + MAX_DISORDER_US


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingOptions:
    """Statements of the user about a file; they beat what the file says and what is guessed.

    Attributes
    ----------
    sensor : (int, int) or None
        Width and height of the sensor, pixels.
    dataset : str or None
        Path of the events in a file that holds several streams.
    time_unit : str or None
        Unit of the times: s, ms, us or ns.
    """

    sensor: tuple[int, int] | None = None
    dataset: str | None = None
    time_unit: str | None = None


class FormatReader(ABC):
    """Reader of one file of one format.

    Attributes
    ----------
    options : ReadingOptions
        Statements of the user.
    takes : tuple of str
        Those of them, besides the sensor, that mean something for the format.
    format : str
        Format and encoding for people.
    strict_order : bool
        Whether late events that are no segment of their own (see `ClockSegments`) make the file unreadable (columns)
        or are dropped (RAW).
    seeks : bool
        Whether `columns` can begin at any `Place` it went by.
    attributes : dict of str to str or float
        Root attributes or header lines.
    warnings : list of str
        Assumptions made on opening.
    time_doubt : str
        Why the times cannot be in the unit assumed, with the options that state one; empty without doubt, and where
        file or user state the unit.
    stated : Resolution or None
        Size of the sensor where the file states it.
    t_offset_us, events : int or None
        DSEC's offset of the file's time; number of events when the file tells without a pass.
    """

    format: str
    strict_order = True
    seeks = False
    takes: ClassVar[tuple[str, ...]] = ()

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        self.path, self.options = path, options
        self.attributes: dict[str, str | float] = {}
        self.warnings: list[str] = []
        self.time_doubt = ""
        self.stated: Resolution | None = None
        self.t_offset_us: int | None = None
        self.events: int | None = None

    @abstractmethod
    def columns(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield the events from `reading.place` on in file order, in parts that are never empty.

        Counts damage and triggers on the way.
        """

    def frames(self, start_us: int, end_us: int) -> Iterator[CameraFrame]:
        """Yield the camera's pictures of [start_us, end_us), where the format holds any."""
        return iter(())

    def truth(self) -> Truth | None:
        """Read the simulator's truth; None when the file has none."""
        return None


@contextmanager
def file_errors(path: Path, kind: str) -> Iterator[None]:
    """Turn whatever libraries raise on a damaged file into a RecordingError of one line."""
    try:
        yield
    except FILE_ERRORS as error:
        why = " ".join(str(error).split())[:200] or type(error).__name__
        raise RecordingError(f"{kind} file is damaged or was cut ({why}): copy or export it again: {path}") from error
