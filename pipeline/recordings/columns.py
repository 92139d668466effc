"""Columns of numbers in HDF5 and NPZ files: their names, and from whatever types they have to events."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from .source import Columns

# Names in use for the four columns, ours and DSEC's first.
NAMES = {
    "t": ("t", "t_us", "ts", "time", "timestamp", "timestamps", "event_t"),
    "x": ("x", "x_px", "xs", "event_x"),
    "y": ("y", "y_px", "ys", "event_y"),
    "p": ("p", "polarity", "polarities", "pol", "on", "event_p"),
}
EXPANSION_LIMIT = 500  # events pack 3 to 50 times; only constant columns come near deflate's 1032
EXPANSION_FREE_BYTES = 1 << 28
LAST_US = 1 << 62  # leaves room to add and subtract


def named_columns(present: Iterable[str]) -> dict[str, str] | None:
    """Which of the names present are t, x, y and p; None unless all four are there."""
    there = set(present)
    found = {c: next((n for n in names if n in there), None) for c, names in NAMES.items()}
    complete = {c: n for c, n in found.items() if n is not None}
    return complete if len(complete) == 4 else None


def refuse_bomb(packed_bytes: int, unpacked_bytes: int, path: Path) -> None:
    """Raise RecordingError for a small file that claims to unpack to something huge."""
    if unpacked_bytes > EXPANSION_FREE_BYTES and unpacked_bytes > EXPANSION_LIMIT * max(packed_bytes, 1):
        raise RecordingError(
            f"the events would unpack from {packed_bytes / 1e6:.3g} MB to {unpacked_bytes / 1e6:.3g} MB, "
            f"over {EXPANSION_LIMIT} times as much: this is no real recording: {path}"
        )


class ColumnTypes:
    """Turns blocks of the four columns of one file into `Columns`.

    Whole-number times are microseconds. Floating times are seconds if any of the first ones has a fraction,
    and microseconds otherwise; `warning` says which was assumed.
    """

    def __init__(self, path: Path, t_type: np.dtype[Any], first_times: NDArray[Any]) -> None:
        self.path = path
        self.warning: str | None = None
        self._seconds = False
        if t_type.kind == "f":
            finite = first_times[np.isfinite(first_times)]
            self._seconds = bool(np.any(finite != np.floor(finite)))
            unit = "seconds (they have fractions)" if self._seconds else "microseconds (they are whole)"
            self.warning = f"times are floating-point numbers without a unit: taken as {unit}"

    def columns(self, first_row: int, t: NDArray[Any], x: NDArray[Any], y: NDArray[Any], p: NDArray[Any]) -> Columns:
        """One block; raises RecordingError naming the first event that cannot be one."""
        if not (t.size == x.size == y.size == p.size):
            raise RecordingError(
                f"columns end early (t {t.size}, x {x.size}, y {y.size}, p {p.size} values from event "
                f"{first_row}): export the recording again: {self.path}"
            )
        return Columns(
            self._times(t, first_row),
            self._pixels("x", x, first_row),
            self._pixels("y", y, first_row),
            self._polarity(p, first_row),
        )

    def _times(self, t: NDArray[Any], first_row: int) -> NDArray[np.int64]:
        if t.dtype.kind == "f":
            with np.errstate(over="ignore"):  # refused below
                t = t.astype(np.float64) * (1e6 if self._seconds else 1.0)
            self._refuse(~(np.abs(t) < LAST_US), "t", t, first_row, "is no time")  # NaN too
            return np.rint(t).astype(np.int64)
        if t.dtype.itemsize == 8 and t.size and (int(t.min()) <= -LAST_US or int(t.max()) >= LAST_US):
            self._refuse((t <= -LAST_US) | (t >= LAST_US), "t", t, first_row, "is no time in microseconds")
        return t.astype(np.int64, copy=False)

    def _pixels(self, name: str, column: NDArray[Any], first_row: int) -> NDArray[Any]:
        if column.dtype.kind == "f":
            self._refuse(
                ~(np.abs(column) < 2**31) | (column != np.floor(column)),
                name,
                column,
                first_row,
                "is no whole pixel",
            )
            column = column.astype(np.int64)
        if column.dtype.kind == "i" and column.size and column.min() < 0:
            self._refuse(column < 0, name, column, first_row, "is negative; pixels count from 0")
        return column

    def _polarity(self, p: NDArray[Any], first_row: int) -> NDArray[np.bool_]:
        if p.dtype.kind == "b":
            return p.astype(np.bool_, copy=False)
        on: NDArray[np.bool_] = p == 1
        self._refuse(~(on | (p == 0) | (p == -1)), "p", p, first_row, "is none of 1 (ON), 0 and -1 (OFF)")
        return on

    def _refuse(self, wrong: NDArray[np.bool_], name: str, column: NDArray[Any], row: int, why: str) -> None:
        if wrong.any():
            at = int(np.argmax(wrong))
            raise RecordingError(f"{name} = {column[at]} at event {row + at} {why}: repair the column: {self.path}")


def refuse_types(path: Path, types: dict[str, np.dtype[Any]]) -> None:
    """Raise RecordingError unless every column holds numbers."""
    for name, dtype in types.items():
        if dtype.kind not in "iufb" or (name in "txy" and dtype.kind == "b"):
            raise RecordingError(f"column {name} holds {dtype}, not numbers: export it as integers: {path}")
