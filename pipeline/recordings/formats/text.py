"""Text files, one event a line: CSV and columns between blanks, plain or packed with gzip or zip."""

from __future__ import annotations

import gzip
import re
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordingError
from ..column_types import (
    BROKEN_FREE,
    BROKEN_SHARE,
    ColumnTypes,
    check_expansion,
    column_order,
    columns_of,
    named_columns,
)
from ..reader import FILE_ERRORS, Damage, FormatReader, ReadingOptions, ReadPass, UncheckedEvents, file_errors
from ..sensor import resolution_or_none
from ..time_units import split_unit
from .registry import FORMATS, RecordingContent, RecordingFormat

SUFFIXES = (".csv", ".txt")
LINE_BYTES = 1000  # longer lines are read as several, none of which is an event
HEAD_LINES = 100  # among which the first event stands: comments, names of columns, size of the sensor
SAMPLED_LINES = 4096  # looked at to tell columns and units apart
COLUMNS = 4
COMMENT = "#%"
GZIP, ZIP = b"\x1f\x8b", b"PK"
PACKING_ERRORS = (EOFError, zlib.error, gzip.BadGzipFile, zipfile.BadZipFile)
TRUTHS = {"true": 1, "false": 0}
# "1280 720", "% geometry 1280x720", "%geometry:1280,720"
_SIZE = re.compile(r"[#%\s]*(?:geometry|resolution|sensor|size)?[\s:=]*(\d+)\s*[x,;\s]\s*(\d+)", re.IGNORECASE)

Number = Callable[[str], float]


class TextLayout(NamedTuple):
    """Arrangement of a text file.

    Attributes
    ----------
    skipped : int
        Lines before the first event.
    separator : str or None
        Between the columns; None for blanks.
    columns : dict of str to int
        Column of t, x, y and p.
    kinds : dict of str to callable
        Type of the numbers in each: int, float, or `truth_value`.
    time_name : str
        Name of the column of times, empty where it has none.
    size : tuple of str, or None
        Width and height of the sensor.
    """

    skipped: int
    separator: str | None
    columns: dict[str, int]
    kinds: dict[str, Number]
    time_name: str
    size: tuple[str, str] | None


class TextReader(FormatReader):
    """Reader of one text file."""

    format = "text"
    takes = ("time_unit",)

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        super().__init__(path, options)
        with file_errors(path, self.format), _lines(path, Damage()) as (lines, _):
            head = list(islice(lines, HEAD_LINES + SAMPLED_LINES))
        self._layout = find_layout(head, path)
        if self._layout.size is not None:
            self.stated = resolution_or_none(*self._layout.size, self.warnings)
        sample = _rows(head[self._layout.skipped :], self._layout, Damage(), len(head))
        unit = split_unit(self._layout.time_name)[1]
        self._types = ColumnTypes(path, options, unit, sample["t"], len(sample))
        self.warnings += self._types.warnings
        self.time_doubt = self._types.time_doubt

    def columns(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield the events; lines that are none are counted as damage."""
        row, size_bytes = 0, self.path.stat().st_size
        with file_errors(self.path, self.format), _lines(self.path, reading.damage) as (all_lines, file):
            lines = islice(all_lines, self._layout.skipped, None)
            while part := list(islice(lines, reading.max_events)):
                allowed = int(BROKEN_FREE + BROKEN_SHARE * (row + len(part)))
                rows = _rows(part, self._layout, reading.damage, allowed)
                if reading.damage.broken_events > allowed:
                    raise RecordingError(
                        f"over {allowed} of the first {row + len(part)} lines are no events: export the text again: "
                        f"{self.path}"
                    )
                block = self._types.columns(row, **{c: rows[c] for c in "txyp"}, damage=reading.damage)
                row += len(part)
                if len(block):
                    yield block
                reading.report(file.tell(), size_bytes)
                if len(block) and reading.is_past(int(block.t_us[-1])):
                    return
        reading.report(1, 1)  # what is left of an archive is its directory


def find_layout(lines: list[str], path: Path) -> TextLayout:
    """Tell the arrangement of a text from its first lines; raises RecordingError where they do not tell it."""
    names: dict[str, int] = {}
    size: tuple[str, str] | None = None
    events = (k for k, line in enumerate(lines[:HEAD_LINES]) if _are_numbers(_words(line)))
    skipped = next(events, len(lines))
    for line in lines[:skipped]:
        heads = _words(line.lstrip(f"{COMMENT} "))
        if named_columns(heads):
            names = {word: k for k, word in enumerate(heads)}
        elif stated := _SIZE.fullmatch(line.strip()):
            size = stated[1], stated[2]
    first = lines[skipped] if skipped < len(lines) else ""
    words = _words(first) if first else list(names)
    sample = [row for row in map(_words, lines[skipped:]) if len(row) == len(words) and _are_numbers(row)]
    found = named_columns(names)
    if found is not None:
        columns = {c: names[name] for c, name in found.items()}
    elif len(words) == COLUMNS:
        columns = column_order(np.array([list(map(_number, row)) for row in sample])) or {}
    else:
        columns = {}
    if not columns or max(columns.values()) >= len(words):
        raise RecordingError(
            f"columns of the text cannot be told apart: give it a first line with names, like t_us,x,y,p: {path}"
        )
    kinds = {c: _kind([row[k] for row in sample]) for c, k in columns.items()}
    return TextLayout(skipped, _separator(first), columns, kinds, found["t"] if found else "", size)


def _separator(line: str) -> str | None:
    return next((mark for mark in ",;" if mark in line), None)


def _words(line: str) -> list[str]:
    return [word.strip().strip("\"'") for word in line.strip().split(_separator(line))]


def _number(word: str) -> float:
    return truth_value(word) if word.lower() in TRUTHS else float(word)


def truth_value(word: str) -> int:
    """1 for "true", 0 for "false" in any case; raises ValueError for other words."""
    if word.strip().lower() not in TRUTHS:
        raise ValueError(f"{word!r} is neither true nor false")
    return TRUTHS[word.strip().lower()]


def _are_numbers(words: list[str]) -> bool:
    """Whether a line with these words may be an event."""
    try:
        return len([_number(word) for word in words]) >= COLUMNS
    except ValueError:
        return False


def _kind(words: list[str]) -> Number:
    if any(word.lower() in TRUTHS for word in words):
        return truth_value
    return int if all(word.lstrip("+-").isdecimal() for word in words) else float


def _rows(lines: list[str], layout: TextLayout, damage: Damage, allowed: int) -> NDArray[Any]:
    """Numbers of the lines.

    Parameters
    ----------
    damage : Damage
        Lines that are no events are added to its `broken_events`.
    allowed : int
        Once there are more than so many of them, no further lines are looked at.

    Returns
    -------
    (n,) record
        Fields t, x, y and p.
    """
    order = sorted(layout.columns, key=lambda c: layout.columns[c])
    dtype = np.dtype([(c, np.float64 if layout.kinds[c] is float else np.int64) for c in order])
    how: dict[str, Any] = {
        "comments": None,
        "delimiter": layout.separator,
        "converters": {layout.columns[c]: truth_value for c in order if layout.kinds[c] is truth_value} or None,
        "usecols": [layout.columns[c] for c in order],
        "ndmin": 1,
        "quotechar": '"',
    }

    def rows_of(part: list[str]) -> list[NDArray[Any]]:
        if not part or damage.broken_events > allowed:
            return []
        try:
            return [np.loadtxt(part, dtype, **how)]
        except (ValueError, OverflowError):
            if len(part) == 1:
                damage.broken_events += 1
                return []
            middle = len(part) // 2
            return rows_of(part[:middle]) + rows_of(part[middle:])

    parts = rows_of([line for line in lines if line.strip() and line[0] not in COMMENT])
    return np.concatenate([np.zeros(0, dtype), *parts])


@contextmanager
def _lines(path: Path, damage: Damage) -> Iterator[tuple[Iterator[str], IO[bytes]]]:
    """Open a text, packed or not: its lines up to damaged packing, and the file on disk for the share that is done."""
    with open(path, "rb") as file:
        head = file.read(2)
        file.seek(0)
        if head == GZIP:
            with gzip.open(file) as unpacked:
                yield _unpacked_lines(unpacked, path, damage), file
        elif head == ZIP:
            with zipfile.ZipFile(file) as archive, archive.open(_texts_in(archive)[0]) as unpacked:
                yield _unpacked_lines(unpacked, path, damage), file
        else:
            yield _unpacked_lines(file, path, damage), file


def _unpacked_lines(file: Any, path: Path, damage: Damage) -> Iterator[str]:
    packed_bytes, unpacked_bytes = path.stat().st_size, 0
    while True:
        try:
            line = file.readline(LINE_BYTES)
        except PACKING_ERRORS:
            damage.broken_ends += 1
            return
        if not line:
            return
        unpacked_bytes += len(line)
        check_expansion(packed_bytes, unpacked_bytes, path)
        yield line.decode("utf-8-sig", "replace")


def _texts_in(archive: zipfile.ZipFile) -> list[str]:
    return [name for name in archive.namelist() if name.lower().endswith(SUFFIXES)]


def is_text(path: Path, head: bytes) -> bool:
    """Whether an event or the names of its columns stand among the first lines of a text, packed or not."""
    if b"\0" in head and not head.startswith((GZIP, ZIP)):
        return False
    try:
        with _lines(path, Damage()) as (lines, _):
            first = list(islice(lines, HEAD_LINES))
    except (*FILE_ERRORS, RecordingError):
        return False
    for line in first:
        if _are_numbers(_words(line)) or named_columns(_words(line.lstrip(f"{COMMENT} "))):
            return True
        if _separator(line) is not None and len(_words(line)) >= COLUMNS and not line.startswith(tuple(COMMENT)):
            return False  # names of other columns: of labels, or of a table of results
    return False


def write_csv(path: Path, content: RecordingContent) -> None:
    """Write a line with the names t_us,x,y,p, then one line an event."""
    with open(path, "wb") as file:
        file.write(b"t_us,x,y,p\n")
        for batch in content.batches:
            np.savetxt(file, np.stack(list(columns_of(batch).values()), axis=1, dtype=np.int64), "%d", ",")


FORMATS.register(
    RecordingFormat(
        name="text",
        label="CSV or text",
        suffixes=SUFFIXES,
        sniff=is_text,
        open=TextReader,
        write=write_csv,
        keeps=frozenset(),
        generic=True,
    )
)
