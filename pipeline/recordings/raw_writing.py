"""Writing Prophesee RAW files in EVT2 and EVT3."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..events import EventBatch
from . import evt2, evt3
from .evt_time import MAX_COORDINATE
from .evt_writing import EVT2_STEP, EVT3_MASK, EVT3_STEP, HIGH, Edges, Encoded, encode_evt2, encode_evt3
from .source import Triggers
from .writing import CheckedEvents, complete_file

# Absolute times are counted up to from 0 in whole turns; more than these would be megabytes of time words.
LAST_US = {"EVT3": 1 << 40, "EVT2": 1 << 52}
VERSION = {"EVT3": "3.0", "EVT2": "2.0"}
OWN_KEYS = ("format", "evt", "geometry", "width", "height", "end")


class RawWriter:
    """A RAW file that grows batch by batch; see `write_raw` in `writing.py`."""

    def __init__(self, file: IO[bytes], checked: CheckedEvents, format: str, triggers: Triggers, path: Path) -> None:
        self._file, self._checked, self._format, self._path = file, checked, format, path
        self._state = np.full(3, -1, np.int64)
        self._edges, self._edge = triggers, 0

    @classmethod
    @contextmanager
    def open(
        cls,
        path: str | Path,
        width_px: int,
        height_px: int,
        format: str,
        attributes: Mapping[str, str | float],
        triggers: Triggers | None,
    ) -> Iterator[RawWriter]:
        """A writer; the file is complete and in place when the context ends without an error."""
        if format not in VERSION:
            raise RecordingError(f"RAW format {format!r} cannot be written, {' and '.join(VERSION)} can: {path}")
        if width_px > MAX_COORDINATE + 1 or height_px > MAX_COORDINATE + 1:
            raise RecordingError(
                f"{format} holds pixels up to {MAX_COORDINATE}, the sensor has {width_px} x {height_px}: "
                f"write HDF5 (.h5) or NPZ (.npz): {path}"
            )
        checked = CheckedEvents(path, width_px, height_px)
        with complete_file(path) as part, open(part, "xb") as file:
            file.write(header(width_px, height_px, format, attributes))
            edges = triggers or Triggers.joined([])
            order = np.argsort(edges.t_us, kind="stable")
            edges = Triggers(edges.t_us[order], edges.value[order], edges.id[order])
            writer = cls(file, checked, format, edges, Path(path))
            yield writer
            writer.finish()

    def append(self, batch: EventBatch) -> None:
        """Add events that follow those before, and the triggers up to the last of them."""
        self._checked.add(batch)
        if len(batch):
            upto = int(np.searchsorted(self._edges.t_us, batch.t_us[-1], side="right"))
            self._write(batch, upto)

    def finish(self) -> None:
        """Add the remaining triggers, and the last time word once more: it confirms the one before."""
        self._write(EventBatch.empty(), len(self._edges))
        high = int(self._state[HIGH])
        if high >= 0 and self._format == "EVT3":
            self._file.write(np.uint16((evt3.TIME_HIGH << 12) | (high & EVT3_MASK)).tobytes())
        elif high >= 0:
            self._file.write(np.uint32((evt2.TIME_HIGH << 28) | (high & evt2.HIGH_MASK)).tobytes())

    def _write(self, batch: EventBatch, upto: int) -> None:
        edges = Edges(*(column[self._edge : upto] for column in _columns(self._edges)))
        self._edge = upto
        ends = [int(c[i]) for c in (batch.t_us, edges.t_us) if c.size for i in (0, -1)]
        if not ends:
            return
        limit_us = LAST_US[self._format]
        if min(ends) < 0 or max(ends) >= limit_us:
            raise RecordingError(
                f"times from {min(ends)} to {max(ends)} us do not fit in {self._format}, which goes from 0 "
                f"to {limit_us} us: write HDF5 (.h5) or NPZ (.npz): {self._path}"
            )
        low_bits, step = (evt3.TIME_BITS, EVT3_STEP) if self._format == "EVT3" else (evt2.LOW_BITS, EVT2_STEP)
        steps = ((max(ends) >> low_bits) - max(int(self._state[HIGH]), 0)) // step
        room = 4 * len(batch) + 3 * edges.t_us.size + steps + 8
        encode, dtype = (encode_evt3, np.uint16) if self._format == "EVT3" else (encode_evt2, np.uint32)
        out = Encoded(np.empty(room, dtype), self._state)
        count = int(encode(out, batch.t_us, batch.x_px, batch.y_px, batch.on, edges))
        self._file.write(out.words[:count].tobytes())


def header(width_px: int, height_px: int, format: str, attributes: Mapping[str, str | float]) -> bytes:
    """The lines of text that a RAW file starts with."""
    lines = {key: value for key, value in attributes.items() if key not in OWN_KEYS}
    lines["evt"] = VERSION[format]
    lines["format"] = f"{format};height={height_px};width={width_px}"
    lines["geometry"] = f"{width_px}x{height_px}"
    text = "".join(f"% {key} {' '.join(str(value).split())}\n" for key, value in lines.items())
    return (text + "% end\n").encode()


def _columns(triggers: Triggers) -> tuple[NDArray[Any], ...]:
    return triggers.t_us, triggers.value, triggers.id
