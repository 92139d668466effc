"""Decoder of ECF, the compression in Prophesee's HDF5 files (filter 0x8ECF), which no plugin package holds.

A block of the file is: a 32-bit word (number of events x 4 + how pixels are packed), the first time as 64
bits, the steps of time as runs, and then x, y and p packed in one of three ways.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from ....compilation import njit
from ....errors import RecordingError
from ....isolation import without_time_limit

Bytes = NDArray[np.uint8]

ALL_PACKED, X_P_PACKED = 2, 1  # bits of the first word
PAD_BYTES = 16  # zeros behind a block: a number cut off by its end is read from them, and found out later
DAMAGED = -1
SHORT_RUN = 4  # events; most runs are not longer


class EcfBlock(NamedTuple):
    """Arrays for the events of one block: t (n,) int64, x, y (n,) uint16, p (n,) int8."""

    t: NDArray[np.int64]
    x: NDArray[np.uint16]
    y: NDArray[np.uint16]
    p: NDArray[np.int8]


class EcfRows:
    """Rows of a chunked dataset of events with ECF as its only filter."""

    def __init__(self, data: h5py.Dataset, path: Path) -> None:
        self._data, self._path = data, path
        self._block_rows = int(data.chunks[0])
        if self._block_rows > 1 << 22:  # Prophesee writes 16384
            raise RecordingError(f"ECF blocks of {self._block_rows} events: the file is damaged: {path}")
        with without_time_limit():
            decode_ecf(_empty_block(0), np.frombuffer(bytes(PAD_BYTES), np.uint8))  # compiles

    def rows_of(self, first: int, upto: int) -> tuple[NDArray[Any], ...]:
        """Decode t, x, y and p of rows [first, upto)."""
        size = self._block_rows
        begin = first - first % size
        out = _empty_block(-(-max(upto - begin, 0) // size) * size)
        for start in range(begin, upto, size):
            block = EcfBlock._make(column[start - begin : start - begin + size] for column in out)
            self._read_block(block, start, min(upto - start, size))
        return tuple(column[first - begin : upto - begin] for column in out)

    def _read_block(self, out: EcfBlock, start: int, needed: int) -> None:
        """Decode the block that begins with row `start`, of which at least the first `needed` rows have to be there."""
        mask, packed = self._data.id.read_direct_chunk((start,))
        if mask:  # stored as it is
            records = np.frombuffer(packed, self._data.dtype, out.t.size)
            out.t[:], out.x[:], out.y[:], out.p[:] = (records[name] for name in "txyp")
        elif decode_ecf(out, np.frombuffer(packed + bytes(PAD_BYTES), np.uint8)) < needed:
            raise RecordingError(
                f"the block of events from {start} on is damaged: copy or export the file again: {self._path}"
            )


def _empty_block(events: int) -> EcfBlock:
    return EcfBlock._make(np.empty(events, dtype) for dtype in (np.int64, np.uint16, np.uint16, np.int8))


@njit(cache=True, nogil=True)
def _number(data: Bytes, at: int, size: int) -> int:
    """Read a little-endian number of `size` bytes, `at` unsigned: signed indices are tested for being from the end."""
    value, first = 0, np.uint64(at)
    for k in range(size):
        value |= int(data[first + np.uint64(k)]) << (8 * k)
    return value


@njit(cache=True, nogil=True)
def _fill(values: NDArray[Any], first: int, upto: int, value: int) -> None:
    """Set values[first:upto], and perhaps some behind them: short runs cost no branch that depends on their length."""
    rest = first
    if first + SHORT_RUN <= values.size:
        for k in range(SHORT_RUN):
            values[np.uint64(first) + np.uint64(k)] = value
        rest = first + SHORT_RUN
    for k in range(rest, upto):
        values[k] = value


@njit(cache=True, nogil=True)
def decode_ecf(out: EcfBlock, data: Bytes) -> int:
    """Decode a block, followed by PAD_BYTES zeros, into `out`; returns the number of events, or DAMAGED."""
    end = data.size - PAD_BYTES
    if end < 12:
        return DAMAGED
    head = _number(data, 0, 4)
    count = head >> 2
    if count > out.t.size:
        return DAMAGED
    # Each part begins where the one before ends, beyond the end of the block where that is cut.
    at = _times(out.t, count, data, 12, _number(data, 4, 8))
    if head & ALL_PACKED:
        at = _packed(out, count, data, at, 4)
    else:
        at = _runs(out.y, count, data, at, 2, 5)
        if head & X_P_PACKED:
            at = _packed(out, count, data, at, 2)
        else:
            at = _runs(out.p, count, data, _columns_masked(out.x, count, data, at), 1, 7)
    return count if at <= end else DAMAGED


@njit(cache=True, nogil=True)
def _times(t: NDArray[np.int64], count: int, data: Bytes, at: int, now: int) -> int:
    """Decode bytes of (step, run length), 4 bits each; step 15: 4 bits of a long step, the low ones first."""
    end = data.size - PAD_BYTES
    done, shift, long_step = 0, 0, 0
    while done < count:
        if at >= end:
            return data.size
        step, run = int(data[at]) >> 4, int(data[at]) & 15
        at += 1
        if step == 15:
            if shift > 56:
                return data.size
            long_step |= run << shift
            shift += 4
            continue
        now += step + long_step
        shift, long_step = 0, 0
        if run == 15:
            run = _number(data, at, 2)
            at += 2
        upto = min(done + run, count)
        _fill(t, done, upto, now)
        done = upto
    return at


@njit(cache=True, nogil=True)
def _runs(values: NDArray[Any], count: int, data: Bytes, at: int, size: int, run_bits: int) -> int:
    """Decode words of `size` bytes: a value, then `run_bits` of run length; all ones = it is in 16 bits more."""
    end, full = data.size - PAD_BYTES, (1 << run_bits) - 1
    done = 0
    while done < count:
        if at >= end:
            return data.size
        word = _number(data, at, size)
        at += size
        run = word & full
        if run == full:
            run = _number(data, at, 2)
            at += 2
        upto = min(done + run, count)
        _fill(values, done, upto, word >> run_bits)
        done = upto
    return at


@njit(cache=True, nogil=True)
def _columns_masked(x: NDArray[np.uint16], count: int, data: Bytes, at: int) -> int:
    """Decode 16-bit words: x above, and 5 bits (highest first) that say which of the next 5 columns follow."""
    end = data.size - PAD_BYTES
    done = 0
    while done < count:
        if at >= end:
            return data.size
        word = _number(data, at, 2)
        at += 2
        x[done] = word >> 5
        done += 1
        for k in range(5 if word & 31 else 0):  # few columns have a neighbour, except at edges
            if done < count and (word >> (4 - k)) & 1:
                x[done] = (word >> 5) + k + 1
                done += 1
    return at


@njit(cache=True, nogil=True)
def _four_values(data: Bytes, at: int, size: int) -> tuple[int, int, int, int]:
    """Read four values of 6 x `size` bits from three words of `size` bytes; the next value's low bits end a word."""
    bits = 2 * size
    low, half, most = (1 << bits) - 1, (1 << 2 * bits) - 1, (1 << 3 * bits) - 1
    a, b, c = _number(data, at, size), _number(data, at + size, size), _number(data, at + 2 * size, size)
    return (a >> bits, (a & low) | ((b >> 2 * bits) << bits), (b & half) | ((c >> 3 * bits) << 2 * bits), c & most)


@njit(cache=True, nogil=True)
def _packed(out: EcfBlock, count: int, data: Bytes, at: int, size: int) -> int:
    """Decode groups of four events: x and p in words of 2 bytes, or y, x and p in words of 4."""
    end = data.size - PAD_BYTES
    for first in range(0, count, 4):
        if at >= end:
            return data.size
        values = _four_values(data, at, size)
        at += 3 * size
        for k in range(min(4, count - first)):
            if size == 4:
                out.y[first + k] = (values[k] >> 12) & 0x7FF
            out.x[first + k] = (values[k] >> 1) & 0x7FF
            out.p[first + k] = values[k] & 1
    return at
