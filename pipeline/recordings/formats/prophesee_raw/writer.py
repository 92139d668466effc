"""Writer of Prophesee RAW files in EVT2 and EVT3."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import closing
from errno import EEXIST
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....compilation import njit
from ....errors import RecordingError
from ....events import EventBatch
from ....files import atomic_file
from ...reader import Triggers
from ..registry import RecordingContent
from . import evt2, evt3
from .decoding import MAX_COORDINATE, TIME_HIGH

HIGH, LOW, ROW = 0, 1, 2  # indices of `Encoded.state`: value written last, -1 before the first
TIME_MASK = (1 << evt3.TIME_BITS) - 1
HIGH_STEP = 1 << (evt3.TIME_BITS - 2)  # TIME_HIGH runs ahead in quarter turns, which no decoder mistakes for steps back
EVT2_HIGH_STEP = 1 << (evt2.HIGH_BITS - 2)
EVT2_TRIGGER_ID, EVT3_TRIGGER_ID = 0x1F, 0xF  # masks of a trigger's number
# Absolute times are counted up to from 0 in whole turns; later ones would need megabytes of time words.
LIMIT_US = 1 << 40
MAX_WORDS = 4  # of an event or trigger: both times, row, column
SPARE_WORDS = 8


class Encoded(NamedTuple):
    """Output of an encoder: words (n,) uint16 in EVT3 and uint32 in EVT2, state (3,) int64."""

    words: NDArray[Any]
    state: NDArray[np.int64]


class RawWriter:
    """A new RAW file that is written as events come; it opens at any time, and cut off anywhere it is read up to there.

    Parameters
    ----------
    path : Path
        File to create.
    named : Path
        Name of it in messages.
    width_px, height_px : int
        Size of the sensor.
    attributes : Mapping of str to str or float
        Statements about camera and scene, for the header.
    encoding : str
        EVT2 or EVT3.

    Raises
    ------
    RecordingError
        For pixels above 2047, and where the file cannot be written.
    FileExistsError
        It exists.
    """

    def __init__(
        self,
        path: Path,
        named: Path,
        width_px: int,
        height_px: int,
        attributes: Mapping[str, str | float],
        encoding: str = "EVT3",
    ) -> None:
        if max(width_px, height_px) > MAX_COORDINATE + 1:
            raise RecordingError(
                f"{encoding} holds pixels up to {MAX_COORDINATE}, the sensor has {width_px} x {height_px}: "
                f"write HDF5 (.h5) or NPZ (.npz): {named}"
            )
        self._named, self._state = named, np.full(3, -1, np.int64)
        self._encoding, self._words = encoding, ENCODINGS[encoding]
        if path.exists():
            raise FileExistsError(EEXIST, os.strerror(EEXIST), str(path))
        lines = {
            **attributes,
            "evt": self._words.version,
            "format": f"{encoding};height={height_px};width={width_px}",
            "geometry": f"{width_px}x{height_px}",
        }
        text = "".join(f"% {key} {' '.join(str(value).split())}\n" for key, value in lines.items())
        with atomic_file(path, "recording") as part:  # a file without its header would not open
            part.write_bytes((text + "% end\n").encode())
        self._file = open(path, "ab")  # noqa: SIM115  until close
        self._encode(EventBatch.empty(), Triggers.empty(), 0)  # has the kernel loaded before events come

    def write(self, events: EventBatch, triggers: Triggers | None = None) -> None:
        """Append events, and triggers that are not later than the last of them, both in order of time.

        Raises RecordingError for times before 0 or beyond 2^40 us (12 days).
        """
        triggers = Triggers.empty() if triggers is None else triggers
        ends = [int(t_us[i]) for t_us in (events.t_us, triggers.t_us) if t_us.size for i in (0, -1)]
        if not ends:
            return
        if min(ends) < 0 or max(ends) >= LIMIT_US:
            raise RecordingError(
                f"times from {min(ends)} to {max(ends)} us do not fit in {self._encoding}, which goes from 0 to "
                f"{LIMIT_US} us: write HDF5 (.h5) or NPZ (.npz): {self._named}"
            )
        steps = ((max(ends) >> self._words.low_bits) - max(int(self._state[HIGH]), 0)) // self._words.high_step
        self._file.write(self._encode(events, triggers, steps))

    def _encode(self, events: EventBatch, triggers: Triggers, steps: int) -> bytes:
        """Words of events and triggers, with so many steps of time between them."""
        words = MAX_WORDS * (len(events) + len(triggers)) + steps + SPARE_WORDS
        out = Encoded(np.empty(words, self._words.dtype), self._state)
        return out.words[: int(self._words.encode(out, *events.columns, *triggers.columns))].tobytes()

    def flush(self, *, to_disk: bool = False) -> None:
        """Hand everything over to the system, which keeps it when this process ends, or to the disk itself."""
        self._file.flush()
        if to_disk:
            os.fsync(self._file.fileno())

    @property
    def size_bytes(self) -> int:
        """Length of the file so far."""
        return self._file.tell()

    def close(self) -> None:
        """Finish the file."""
        try:
            if self._state[HIGH] >= 0:  # once more: confirms the one before
                high = int(self._state[HIGH]) & self._words.high_mask
                self._file.write(self._words.dtype(TIME_HIGH << self._words.high_bits | high).tobytes())
        finally:
            self._file.close()


def write_raw(path: Path, content: RecordingContent) -> None:
    """Write a new file in the content's encoding, with triggers among the events.

    Raises RecordingError for pixels above 2047, and for times before 0 or beyond 2^40 us (12 days).
    """
    triggers = content.triggers()
    triggers = triggers[np.argsort(triggers.t_us, kind="stable")]
    size_px = (content.width_px, content.height_px)
    with closing(RawWriter(path, content.path, *size_px, content.attributes, content.encoding)) as writer:
        for batch in content.batches:
            upto = int(np.searchsorted(triggers.t_us, batch.t_us[-1], side="right"))
            writer.write(batch, triggers[:upto])
            triggers = triggers[upto:]
        writer.write(EventBatch.empty(), triggers)


@njit(cache=True, nogil=True)
def _write_time(out: Encoded, at: int, t_us: int) -> int:
    """Write the time words up to a time; returns the index of the next word."""
    state, high, low = out.state, t_us >> evt3.TIME_BITS, t_us & TIME_MASK
    if state[HIGH] < 0:
        state[HIGH] = high if high <= TIME_MASK else 0  # later times are counted up to
        out.words[at] = (TIME_HIGH << 12) | state[HIGH]
        at += 1
    while state[HIGH] < high:
        state[HIGH] = min(state[HIGH] + HIGH_STEP, high)
        state[LOW] = -1
        out.words[at] = (TIME_HIGH << 12) | (state[HIGH] & TIME_MASK)
        at += 1
    if state[LOW] != low:
        state[LOW] = low
        out.words[at] = (evt3.TIME_LOW << 12) | low
        at += 1
    return at


@njit(cache=True, nogil=True)
def encode_evt3(
    out: Encoded,
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    on: NDArray[np.bool_],
    edge_t_us: NDArray[np.int64],
    edge_value: NDArray[np.uint8],
    edge_id: NDArray[np.uint8],
) -> int:
    """Encode events and trigger edges, both in order of time, into `out`; returns the number of words."""
    at, edge = 0, 0
    for i in range(t_us.size + 1):
        while edge < edge_t_us.size and (i == t_us.size or edge_t_us[edge] <= t_us[i]):
            at = _write_time(out, at, edge_t_us[edge])
            out.words[at] = (
                (evt3.EXT_TRIGGER << 12) | ((int(edge_id[edge]) & EVT3_TRIGGER_ID) << 8) | int(edge_value[edge])
            )
            at += 1
            edge += 1
        if i == t_us.size:
            break
        at = _write_time(out, at, t_us[i])
        if out.state[ROW] != y_px[i]:
            out.state[ROW] = y_px[i]
            out.words[at] = (evt3.ADDR_Y << 12) | int(y_px[i])
            at += 1
        out.words[at] = (evt3.ADDR_X << 12) | (int(on[i]) << 11) | int(x_px[i])
        at += 1
    return at


@njit(cache=True, nogil=True)
def encode_evt2(
    out: Encoded,
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    on: NDArray[np.bool_],
    edge_t_us: NDArray[np.int64],
    edge_value: NDArray[np.uint8],
    edge_id: NDArray[np.uint8],
) -> int:
    """Encode as `encode_evt3` does, in EVT2."""
    words, state = out.words, out.state
    at, edge, event = 0, 0, 0
    while edge < edge_t_us.size or event < t_us.size:
        is_edge = edge < edge_t_us.size and (event == t_us.size or edge_t_us[edge] <= t_us[event])
        now_us = edge_t_us[edge] if is_edge else t_us[event]
        high = now_us >> evt2.LOW_BITS
        while state[HIGH] < high:
            is_first = state[HIGH] < 0
            state[HIGH] = min(state[HIGH] + EVT2_HIGH_STEP, high)
            if is_first:
                state[HIGH] = high if high <= evt2.HIGH_MASK else 0  # later times are counted up to
            words[at] = (TIME_HIGH << evt2.HIGH_BITS) | (state[HIGH] & evt2.HIGH_MASK)
            at += 1
        low = (now_us & evt2.LOW_MASK) << evt2.TIME_SHIFT
        if is_edge:
            number = (int(edge_id[edge]) & EVT2_TRIGGER_ID) << evt2.TRIGGER_ID_SHIFT
            words[at] = (evt2.EXT_TRIGGER << evt2.HIGH_BITS) | low | number | int(edge_value[edge])
            edge += 1
        else:
            words[at] = (int(on[event]) << evt2.HIGH_BITS) | low | (int(x_px[event]) << evt2.X_SHIFT) | int(y_px[event])
            event += 1
        at += 1
    return at


class RawEncoding(NamedTuple):
    """Encoding of RAW that is written: its kernel and the bits of its time words."""

    version: str
    dtype: type[np.unsignedinteger[Any]]
    low_bits: int
    high_bits: int
    high_mask: int
    high_step: int
    encode: Callable[..., int]


ENCODINGS = {
    "EVT2": RawEncoding("2.0", np.uint32, evt2.LOW_BITS, evt2.HIGH_BITS, evt2.HIGH_MASK, EVT2_HIGH_STEP, encode_evt2),
    "EVT3": RawEncoding("3.0", np.uint16, evt3.TIME_BITS, evt3.TIME_BITS, TIME_MASK, HIGH_STEP, encode_evt3),
}
