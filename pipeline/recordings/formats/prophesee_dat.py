"""Prophesee DAT: a header of text lines, two bytes, then 64 bits an event."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...errors import RecordingError
from ..prophesee_header import MAX_HEADER_BYTES, parse_header
from ..reader import FormatReader, Place, ReadingOptions, ReadPass, UncheckedEvents, file_errors
from ..sensor import resolution_or_none
from .registry import FORMATS, RecordingContent, RecordingFormat

EVENT_BYTES = 8
EVENT_KINDS = (0x00, 0x0C)  # 2D events of version 1 and CD events of version 2
LAST_US = (1 << 32) - 1
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
        """Yield the events; times that the following ones contradict are left out, as `decode_dat` says."""
        from ..dat_decoding import EVENTS, NOW, OUTSIDE, STATE_SIZE, TIME_JUMPS, DatEvents, decode_dat  # loads numba

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
                words = np.frombuffer(data, "<u4", len(data) // EVENT_BYTES * 2).reshape(-1, 2)
                columns = (np.empty(len(words), dtype) for dtype in (np.int64, np.uint16, np.uint16, np.bool_))
                out = DatEvents._make([*columns, state])
                done = int(decode_dat(out, words, final)) * EVENT_BYTES
                offset, rest = offset + done, data[done:]
                reading.damage.time_jumps += int(state[TIME_JUMPS])
                reading.damage.outside_events += int(state[OUTSIDE])
                reading.place = Place(offset, (int(state[NOW]),))
                if state[EVENTS]:
                    yield UncheckedEvents(out.t_us, out.x_px, out.y_px, out.on)[: int(state[EVENTS])]
                reading.report(offset - self._start, self._end - self._start)
        reading.damage.lost_bytes += len(rest)


def is_dat(path: Path, head: bytes) -> bool:
    """Whether a file starts like DAT: by its first line, or else by the two bytes behind its header."""
    if head.startswith(b"% Data file"):
        return True
    header, end = parse_header(head)
    names_encoding = "evt" in header or "format" in header  # RAW
    return (
        end > 0 and not names_encoding and head[end : end + 2] in [bytes((kind, EVENT_BYTES)) for kind in EVENT_KINDS]
    )


def write_dat(path: Path, content: RecordingContent) -> None:
    """Write a new file; raises RecordingError for times that do not fit in 32 bits."""
    lines = {**content.attributes, "Version": 2, "Width": content.width_px, "Height": content.height_px}
    text = "".join(f"% {name} {' '.join(str(value).split())}\n" for name, value in lines.items())
    with open(path, "xb") as file:
        file.write(f"% Data file containing CD events\n{text}% end\n".encode() + bytes((EVENT_KINDS[1], EVENT_BYTES)))
        for batch in content.batches:
            first_us, last_us = int(batch.t_us[0]), int(batch.t_us[-1])
            if first_us < 0 or last_us > LAST_US:
                raise RecordingError(
                    f"times from {first_us} to {last_us} us do not fit in DAT, which goes from 0 to {LAST_US} us "
                    f"(71 minutes): write HDF5 (.h5) or a part (--window): {content.path}"
                )
            words = np.empty(len(batch), FIELDS)
            words["t"] = batch.t_us
            words["pixel"] = batch.on.astype(np.uint32) << 28 | batch.y_px.astype(np.uint32) << 14 | batch.x_px
            file.write(words.tobytes())


FORMATS.register(
    RecordingFormat(
        name="prophesee_dat",
        label="Prophesee DAT",
        suffixes=(".dat",),
        sniff=is_dat,
        open=DatReader,
        write=write_dat,
        keeps=frozenset({"sensor", "attributes"}),
    )
)
