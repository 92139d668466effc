"""Prophesee DAT: a header of text lines, two bytes, then 64 bits an event."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...errors import RecordingError
from ..prophesee_header import MAX_HEADER_BYTES, parse_header
from ..reader import FormatReader, Place, ReadingOptions, ReadPass, UncheckedEvents, file_errors
from ..sensor import resolution_or_none
from .registry import FORMATS, RecordingFormat

EVENT_BYTES = 8
EVENT_KINDS = (0x00, 0x0C)  # 2D events of version 1 and CD events of version 2
FIELDS = np.dtype([("t", "<u4"), ("pixel", "<u4")])  # pixel: x 14 bits, y 14 bits, polarity 4 bits


class DatReader(FormatReader):
    """Reader of one DAT recording."""

    format = "DAT"
    strict_order = False
    seeks = True

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        super().__init__(path, options)
        with file_errors(path, "DAT"), open(path, "rb") as file:
            header, start = parse_header(file.read(MAX_HEADER_BYTES))
            file.seek(start)
            kind, size = (*file.read(2), 0, 0)[:2]
            self._start, self._end = start + 2, file.seek(0, 2)
        self.attributes |= header
        if self._end > start and (kind not in EVENT_KINDS or size != EVENT_BYTES):
            raise RecordingError(
                f"DAT file holds events of kind {kind} with {size} bytes, not CD events (kind 12, 8 bytes): "
                f"export the CD events: {path}"
            )
        self.events = max(self._end - self._start, 0) // EVENT_BYTES
        if "Width" in header and "Height" in header:
            self.stated = resolution_or_none(header["Width"], header["Height"], self.warnings)

    def columns(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield the events; times that fall by more than half of the 32 bits have wrapped (after 71 minutes)."""
        start, (before, turns) = reading.place or Place(self._start, (0, 0))
        with file_errors(self.path, "DAT"), open(self.path, "rb") as file:
            file.seek(start)
            while block := file.read(reading.max_events * EVENT_BYTES):
                lost = len(block) % EVENT_BYTES
                events = np.frombuffer(block[: len(block) - lost], FIELDS)
                reading.damage.lost_bytes += lost
                if not events.size:
                    break
                t = events["t"].astype(np.int64)
                wraps = np.cumsum(np.diff(t, prepend=before) < -(1 << 31)) + turns
                before, turns = int(t[-1]), int(wraps[-1])
                reading.place = Place(file.tell() - lost, (before, turns))
                pixel = events["pixel"]
                yield UncheckedEvents(t + (wraps << 32), pixel & 0x3FFF, (pixel >> 14) & 0x3FFF, pixel >> 28 != 0)
                reading.report(file.tell() - self._start, self._end - self._start)


def is_dat(path: Path, head: bytes) -> bool:
    """Whether a file starts like DAT: by its first line, or else by the two bytes behind its header."""
    if head.startswith(b"% Data file"):
        return True
    header, end = parse_header(head)
    names_encoding = "evt" in header or "format" in header  # RAW
    return (
        end > 0 and not names_encoding and head[end : end + 2] in [bytes((kind, EVENT_BYTES)) for kind in EVENT_KINDS]
    )


FORMATS.register(
    RecordingFormat(name="prophesee_dat", label="Prophesee DAT", suffixes=(".dat",), sniff=is_dat, open=DatReader)
)
