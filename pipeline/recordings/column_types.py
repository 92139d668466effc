"""Columns of events in HDF5 and NPZ files: names, types, and conversion to events."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..events import EventBatch
from .reader import UncheckedEvents

# Names in use for the four columns, ours and DSEC's first.
NAMES = {
    "t": ("t", "t_us", "ts", "time", "timestamp", "timestamps", "event_t"),
    "x": ("x", "x_px", "xs", "event_x"),
    "y": ("y", "y_px", "ys", "event_y"),
    "p": ("p", "polarity", "polarities", "pol", "on", "event_p"),
}
# As Spinscope writes them.
COLUMN_TYPES = {name: np.dtype(code) for name, code in zip("txyp", ("<i8", "<u2", "<u2", "u1"), strict=True)}
EXPANSION_LIMIT = 500  # events pack 3 to 50 times; only constant columns come near deflate's 1032
EXPANSION_FREE_BYTES = 1 << 28
LAST_US = 1 << 62  # leaves room to add and subtract


def named_columns(present: Iterable[str]) -> dict[str, str] | None:
    """Map t, x, y and p to those of the names present that stand for them; None unless all four are there."""
    there = set(present)
    found = {c: next(n for n in names if n in there) for c, names in NAMES.items() if not there.isdisjoint(names)}
    return found if len(found) == 4 else None


def columns_of(batch: EventBatch) -> dict[str, NDArray[Any]]:
    """Columns of a batch by name, in `COLUMN_TYPES`."""
    return {"t": batch.t_us, "x": batch.x_px, "y": batch.y_px, "p": batch.on.view(np.uint8)}


def check_expansion(packed_bytes: int, unpacked_bytes: int, path: Path) -> None:
    """Raise RecordingError for a small file that claims to unpack to something huge."""
    if unpacked_bytes > EXPANSION_FREE_BYTES and unpacked_bytes > EXPANSION_LIMIT * max(packed_bytes, 1):
        raise RecordingError(
            f"the events would unpack from {packed_bytes / 1e6:.3g} MB to {unpacked_bytes / 1e6:.3g} MB, "
            f"over {EXPANSION_LIMIT} times as much: this is no real recording: {path}"
        )


class ColumnTypes:
    """Conversion of the four columns of one file to events.

    Whole-number times are microseconds. Floating times are seconds if any of those looked at has a fraction, and
    microseconds otherwise; `warning` says which was assumed.
    """

    def __init__(self, path: Path, sampled_times: NDArray[Any]) -> None:
        self.path = path
        self.warning: str | None = None
        self._seconds = False
        if sampled_times.dtype.kind == "f":
            finite = sampled_times[np.isfinite(sampled_times)]
            self._seconds = bool(np.any(finite != np.floor(finite)))
            unit = "seconds (they have fractions)" if self._seconds else "microseconds (they are whole)"
            self.warning = f"times are floating-point numbers without a unit: taken as {unit}"

    def columns(
        self, first_row: int, t: NDArray[Any], x: NDArray[Any], y: NDArray[Any], p: NDArray[Any]
    ) -> UncheckedEvents:
        """Convert the rows from first_row on; raises RecordingError naming the first event that cannot be one."""
        if not (t.size == x.size == y.size == p.size):
            raise RecordingError(
                f"columns end early (t {t.size}, x {x.size}, y {y.size}, p {p.size} values from event "
                f"{first_row}): export the recording again: {self.path}"
            )
        return UncheckedEvents(
            self._times(t, first_row),
            self._pixels("x", x, first_row),
            self._pixels("y", y, first_row),
            self._polarity(p, first_row),
        )

    def _times(self, t: NDArray[Any], first_row: int) -> NDArray[np.int64]:
        if t.dtype.kind == "f":
            with np.errstate(over="ignore"):  # refused below
                t = t.astype(np.float64) * (1e6 if self._seconds else 1.0)
            self._check(~(np.abs(t) < LAST_US), "t", t, first_row, "is no time")  # NaN too
            return np.rint(t).astype(np.int64)
        if t.dtype.itemsize == 8 and t.size and (int(t.min()) <= -LAST_US or int(t.max()) >= LAST_US):
            self._check((t <= -LAST_US) | (t >= LAST_US), "t", t, first_row, "is no time in microseconds")
        return t.astype(np.int64, copy=False)

    def _pixels(self, name: str, column: NDArray[Any], first_row: int) -> NDArray[Any]:
        if column.dtype.kind == "f":
            broken = ~(np.abs(column) < 2**31) | (column != np.floor(column))
            self._check(broken, name, column, first_row, "is no whole pixel")
            column = column.astype(np.int64)
        if column.dtype.kind == "i" and column.size and column.min() < 0:
            self._check(column < 0, name, column, first_row, "is negative; pixels count from 0")
        return column

    def _polarity(self, p: NDArray[Any], first_row: int) -> NDArray[np.bool_]:
        if p.dtype.kind == "b":
            return p.astype(np.bool_, copy=False)
        on: NDArray[np.bool_] = p == 1
        self._check(~(on | (p == 0) | (p == -1)), "p", p, first_row, "is none of 1 (ON), 0 and -1 (OFF)")
        return on

    def _check(self, wrong: NDArray[np.bool_], name: str, column: NDArray[Any], row: int, why: str) -> None:
        if wrong.any():
            at = int(np.argmax(wrong))
            raise RecordingError(f"{name} = {column[at]} at event {row + at} {why}: repair the column: {self.path}")


def check_types(path: Path, types: dict[str, np.dtype[Any]]) -> None:
    """Raise RecordingError unless every column holds numbers."""
    for name, dtype in types.items():
        if dtype.kind not in "iufb" or (name in "txy" and dtype.kind == "b"):
            raise RecordingError(f"column {name} holds {dtype}, not numbers: export it as integers: {path}")
