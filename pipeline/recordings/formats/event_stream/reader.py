"""Reader of Event Stream recordings."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ....errors import RecordingError
from ...reader import FormatReader, Place, ReadingOptions, ReadPass, UncheckedEvents, file_errors
from ...sensor import resolution_or_none
from .decoding import EVENT_BYTES, EVENTS, NOW, STATE_SIZE, EventStreamEvents, decode_event_stream

HEADER = struct.Struct("<12s3BBHH")  # "Event Stream", version, type, width, height
KINDS = ("generic", "DVS", "ATIS", "display", "color")
DVS, ATIS = 1, 2


class EventStreamReader(FormatReader):
    """Reader of one Event Stream recording."""

    strict_order = False
    seeks = True

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        super().__init__(path, options)
        with file_errors(path, "Event Stream"), open(path, "rb") as file:
            _, major, minor, patch, kind, width, height = HEADER.unpack(file.read(HEADER.size))
        if major != 2 or kind not in (DVS, ATIS):
            what = KINDS[kind] if kind < len(KINDS) else f"unknown ({kind})"
            raise RecordingError(
                f"Event Stream of version {major}.{minor}.{patch} with {what} events is not read: convert it to "
                f"version 2 with DVS events: {path}"
            )
        self._is_atis = kind == ATIS
        self.format = f"Event Stream ({KINDS[kind]})"
        self.stated = resolution_or_none(width, height, self.warnings)

    def columns(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield the events."""
        place = reading.place or Place(HEADER.size, (0,))
        offset, state = place.offset, np.zeros(STATE_SIZE, np.int64)
        (state[NOW],) = place.state
        rest = b""
        with file_errors(self.path, "Event Stream"), open(self.path, "rb") as file:
            size = file.seek(0, 2)
            file.seek(offset)
            while block := file.read(reading.max_events * EVENT_BYTES):
                data = rest + block
                while True:
                    room = reading.room(reading.max_events)
                    out = EventStreamEvents(*room, state)
                    done = int(decode_event_stream(out, np.frombuffer(data, np.uint8), self._is_atis))
                    data, offset = data[done:], offset + done
                    reading.place = Place(offset, (int(state[NOW]),))
                    events = int(state[EVENTS])
                    if not events:
                        break
                    yield reading.decoded(room, events)
                rest = data
                reading.report(file.tell(), size)
            reading.damage.lost_bytes += len(rest)
