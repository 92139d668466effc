"""Reading Prophesee DAT files: a header of text lines, two bytes, then 64 bits an event."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import RecordingError
from ..results import Truth
from .raw import HEADER_BYTES, parsed_header
from .sensor import stated_or_none
from .source import Columns, Pass, translated

EVENT_BYTES = 8
EVENT_KINDS = (0x00, 0x0C)  # 2D events of version 1 and CD events of version 2
FIELDS = np.dtype([("t", "<u4"), ("pixel", "<u4")])  # pixel: x 14 bits, y 14 bits, polarity 4 bits


class DatSource:
    """One DAT recording."""

    format = "DAT"
    order_is_law = False
    t_offset_us: int | None = None

    def __init__(self, path: Path) -> None:
        self.path = path
        self.warnings: list[str] = []
        with translated(path, "DAT"), open(path, "rb") as file:
            header, start = parsed_header(file.read(HEADER_BYTES))
            file.seek(start)
            kind, size = (*file.read(2), 0, 0)[:2]
            self._start, self._end = start + 2, file.seek(0, 2)
        self.attributes: dict[str, str | float] = dict(header)
        if self._end > start and (kind not in EVENT_KINDS or size != EVENT_BYTES):
            raise RecordingError(
                f"DAT file holds events of kind {kind} with {size} bytes, not CD events (kind 12, 8 bytes): "
                f"export the CD events: {path}"
            )
        self.events: int | None = max(self._end - self._start, 0) // EVENT_BYTES
        self.stated = None
        if "Width" in header and "Height" in header:
            self.stated = stated_or_none(header["Width"], header["Height"], self.warnings)

    def columns(self, reading: Pass) -> Iterator[Columns]:
        """The events; times that fall by more than half of the 32 bits have wrapped (after 71 minutes)."""
        before, turns = 0, 0
        with translated(self.path, "DAT"), open(self.path, "rb") as file:
            file.seek(self._start)
            while block := file.read(reading.max_events * EVENT_BYTES):
                lost = len(block) % EVENT_BYTES
                events = np.frombuffer(block[: len(block) - lost], FIELDS)
                reading.damage.lost_bytes += lost
                if not events.size:
                    break
                t = events["t"].astype(np.int64)
                wraps = np.cumsum(np.diff(t, prepend=before) < -(1 << 31)) + turns
                before, turns = int(t[-1]), int(wraps[-1])
                pixel = events["pixel"]
                yield Columns(t + (wraps << 32), pixel & 0x3FFF, (pixel >> 14) & 0x3FFF, pixel >> 28 != 0)
                reading.report(file.tell() - self._start, self._end - self._start)

    def truth(self) -> Truth | None:
        """DAT files hold none."""
        return None
