"""Writer of Prophesee RAW files in EVT2 and EVT3."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....compilation import njit
from ....errors import RecordingError
from ....events import EventBatch
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


class Encoded(NamedTuple):
    """Output of an encoder: words (n,) uint16 in EVT3 and uint32 in EVT2, state (3,) int64."""

    words: NDArray[Any]
    state: NDArray[np.int64]


def write_raw(path: Path, content: RecordingContent) -> None:
    """Write a new file in the content's encoding, with triggers among the events.

    Raises RecordingError for pixels above 2047, and for times before 0 or beyond 2^40 us (12 days).
    """
    if max(content.width_px, content.height_px) > MAX_COORDINATE + 1:
        raise RecordingError(
            f"{content.encoding} holds pixels up to {MAX_COORDINATE}, the sensor has {content.width_px} x "
            f"{content.height_px}: write HDF5 (.h5) or NPZ (.npz): {content.path}"
        )
    triggers = content.triggers()
    triggers = triggers[np.argsort(triggers.t_us, kind="stable")]
    state = np.full(3, -1, np.int64)
    encode = _encode_evt2 if content.encoding == "EVT2" else _encode_evt3
    with open(path, "xb") as file:
        file.write(_header(content))
        for batch in content.batches:
            upto = int(np.searchsorted(triggers.t_us, batch.t_us[-1], side="right"))
            _write_words(file, encode, state, batch, triggers[:upto], content)
            triggers = triggers[upto:]
        _write_words(file, encode, state, EventBatch.empty(), triggers, content)
        if state[HIGH] >= 0:  # once more: confirms the one before
            file.write(_confirmation(content.encoding, int(state[HIGH])))


def _header(content: RecordingContent) -> bytes:
    lines = {
        **content.attributes,
        "evt": {"EVT2": "2.0", "EVT3": "3.0"}[content.encoding],
        "format": f"{content.encoding};height={content.height_px};width={content.width_px}",
        "geometry": f"{content.width_px}x{content.height_px}",
    }
    text = "".join(f"% {key} {' '.join(str(value).split())}\n" for key, value in lines.items())
    return (text + "% end\n").encode()


def _confirmation(encoding: str, high: int) -> bytes:
    if encoding == "EVT2":
        return np.uint32((TIME_HIGH << evt2.HIGH_BITS) | (high & evt2.HIGH_MASK)).tobytes()
    return np.uint16((TIME_HIGH << evt3.TIME_BITS) | (high & TIME_MASK)).tobytes()


def _write_words(
    file: IO[bytes],
    encode: Callable[[NDArray[np.int64], EventBatch, Triggers, int], Encoded],
    state: NDArray[np.int64],
    batch: EventBatch,
    triggers: Triggers,
    content: RecordingContent,
) -> None:
    """Encode and write events, and triggers that are not later than the last of them."""
    ends = [int(t_us[i]) for t_us in (batch.t_us, triggers.t_us) if t_us.size for i in (0, -1)]
    if not ends:
        return
    if min(ends) < 0 or max(ends) >= LIMIT_US:
        raise RecordingError(
            f"times from {min(ends)} to {max(ends)} us do not fit in {content.encoding}, which goes from 0 to "
            f"{LIMIT_US} us: write HDF5 (.h5) or NPZ (.npz): {content.path}"
        )
    file.write(encode(state, batch, triggers, max(ends)).words.tobytes())


def _encode_evt3(state: NDArray[np.int64], batch: EventBatch, triggers: Triggers, end_us: int) -> Encoded:
    steps = ((end_us >> evt3.TIME_BITS) - max(int(state[HIGH]), 0)) // HIGH_STEP
    out = Encoded(np.empty(4 * len(batch) + 3 * len(triggers) + steps + 8, np.uint16), state)
    count = int(encode_evt3(out, *batch.columns, *triggers.columns))
    return Encoded(out.words[:count], state)


def _encode_evt2(state: NDArray[np.int64], batch: EventBatch, triggers: Triggers, end_us: int) -> Encoded:
    steps = ((end_us >> evt2.LOW_BITS) - max(int(state[HIGH]), 0)) // EVT2_HIGH_STEP
    out = Encoded(np.empty(2 * (len(batch) + len(triggers)) + steps + 2, np.uint32), state)
    count = int(encode_evt2(out, *batch.columns, *triggers.columns))
    return Encoded(out.words[:count], state)


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
