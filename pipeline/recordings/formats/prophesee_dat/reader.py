"""Reader of Prophesee DAT files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ....errors import RecordingError
from ...prophesee_header import MAX_HEADER_BYTES, parse_header
from ...reader import FormatReader, Place, ReadingOptions, ReadPass, UncheckedEvents, file_errors
from ...sensor import resolution_or_none
from .decoding import EVENTS, NOW, OUTSIDE, STATE_SIZE, TIME_JUMPS, DatEvents, decode_dat
from .header import EVENT_BYTES, EVENT_KINDS


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
        """Yield the events; times that the following ones contradict are left out, as `decode_dat` says."""
        place = reading.place or Place(self._start, (-1,))
        state = np.zeros(STATE_SIZE, np.int64)
        state[NOW] = place.state[0]
        offset, rest, final = place.offset, b"", False
        with file_errors(self.path, "DAT"), open(self.path, "rb") as file:
            file.seek(offset)
            while not final:
                block = file.read(reading.max_events * EVENT_BYTES)
                final = not block
                data = rest + block
                words = np.frombuffer(data, "<i8", len(data) // EVENT_BYTES)
                room = reading.room(len(words))
                done = int(decode_dat(DatEvents(*room, state), words, final)) * EVENT_BYTES
                offset, rest = offset + done, data[done:]
                reading.damage.time_jumps += int(state[TIME_JUMPS])
                reading.damage.outside_events += int(state[OUTSIDE])
                reading.place = Place(offset, (int(state[NOW]),))
                if state[EVENTS]:
                    yield reading.decoded(room, int(state[EVENTS]))
                reading.report(offset - self._start, self._end - self._start)
        reading.damage.lost_bytes += len(rest)
