"""Columns of events in files of columns: names, order, types, and conversion to events."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..events import EventBatch
from .reader import LAST_US, Damage, ReadingOptions, UncheckedEvents
from .time_units import (
    UNITS_US,
    check_unit,
    is_slow_throughout,
    microseconds,
    rate_warning,
    resolution_warning,
    split_unit,
)

# Names in use for the four columns, in lower case and without a unit behind them; ours and DSEC's first.
NAMES = {
    "t": ("t", "ts", "time", "timestamp", "timestamps", "event_t", "events_t"),
    "x": ("x", "x_px", "xs", "event_x", "events_x"),
    "y": ("y", "y_px", "ys", "event_y", "events_y"),
    "p": ("p", "polarity", "polarities", "pol", "ps", "on", "event_p", "events_p"),
}
# As Spinscope writes them.
COLUMN_TYPES = {name: np.dtype(code) for name, code in zip("txyp", ("<i8", "<u2", "<u2", "u1"), strict=True)}
EXPANSION_LIMIT = 500  # events pack 3 to 50 times; only constant columns come near deflate's 1032
EXPANSION_FREE_BYTES = 1 << 28
# So many broken rows cost only themselves; more are a sign that the columns are not what they are taken for.
BROKEN_FREE, BROKEN_SHARE = 10, 0.01
NONE = np.zeros(0, np.bool_)  # mask of a column without broken values
SORTED_SHARE = 0.9  # of the steps of a column of times that do not go back


def named_columns(present: Iterable[str]) -> dict[str, str] | None:
    """Map t, x, y and p to those of the names present that stand for them; None unless all four are there."""
    there = {split_unit(name.strip().lower())[0]: name for name in present}
    found = {c: [there[name] for name in names if name in there] for c, names in NAMES.items()}
    return {c: names[0] for c, names in found.items()} if all(found.values()) else None


def column_order(sample: NDArray[Any]) -> dict[str, int] | None:
    """Tell the four columns of a table without names apart.

    Parameters
    ----------
    sample : (n, 4) number
        First rows of the table.

    Returns
    -------
    dict of str to int or None
        Column of t, x, y and p: p is the last that holds -1, 0 and 1 only, t the one of the others that goes back least
        often, then that with the longest span; x comes before y. None where no column can be p or t.
    """
    polarities = [k for k in range(4) if np.isin(sample[:, k], (-1, 0, 1)).all()]
    if not polarities:
        return None
    p = polarities[-1]
    values = sample.astype(np.float64)
    rising = [float(np.mean(np.diff(values[:, k]) >= 0)) if len(values) > 1 else 1.0 for k in range(4)]
    rest = [k for k in range(4) if k != p]
    t = max(rest, key=lambda k: (rising[k], np.ptp(values[:, k]) if len(values) else 0.0))
    if rising[t] < SORTED_SHARE:
        return None
    x, y = (k for k in rest if k != t)
    return {"t": t, "x": x, "y": y, "p": p}


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

    The unit of time is the user's, else the file's. Else whole-number times are microseconds; floating times are
    seconds if any of those looked at has a fraction, and microseconds otherwise.

    Attributes
    ----------
    warnings : list of str
        What was assumed, and what is implausible about it.
    time_doubt : str
        As of `FormatReader`.
    """

    def __init__(
        self, path: Path, options: ReadingOptions, stated: str | None, sampled_times: NDArray[Any], events: int
    ) -> None:
        """Choose the unit of time.

        Parameters
        ----------
        stated : str or None
            Unit that the file states.
        sampled_times, events : (n,) number, int
            Some of the times, and the number of events between the first and the last of them.
        """
        self.path = path
        self.warnings: list[str] = []
        self.time_doubt = ""
        check_unit(options.time_unit)
        finite = sampled_times[np.isfinite(sampled_times)] if sampled_times.dtype.kind == "f" else sampled_times
        self.unit = options.time_unit or stated or "us"
        if options.time_unit:
            return
        if sampled_times.dtype.kind == "f" and not stated:
            self.unit = "s" if np.any(finite != np.floor(finite)) else "us"
            why = "seconds (they have fractions)" if self.unit == "s" else "microseconds (they are whole)"
            self.warnings.append(f"times are floating-point numbers without a unit: taken as {why}")
        if finite.size:
            warning = rate_warning(self.unit, events, float(np.ptp(finite)))
            if warning and not stated and is_slow_throughout(self.unit, finite):
                self.time_doubt = f"{warning}, or --time-unit {self.unit} if that is right"
            elif warning is None and not stated and sampled_times.dtype.kind in "iu":
                warning = resolution_warning(sampled_times)
            self.warnings += [warning] if warning else []

    def columns(
        self, first_row: int, t: NDArray[Any], x: NDArray[Any], y: NDArray[Any], p: NDArray[Any], damage: Damage
    ) -> UncheckedEvents:
        """Convert the rows from first_row on; those with a value that no event can have are dropped as damage.

        Raises RecordingError when the columns differ in length, and when so many rows are broken that the columns are
        not what they are taken for.
        """
        if not (t.size == x.size == y.size == p.size):
            raise RecordingError(
                f"columns end early (t {t.size}, x {x.size}, y {y.size}, p {p.size} values from event "
                f"{first_row}): export the recording again: {self.path}"
            )
        for name, column, broken, why in (
            ("t", t, self._no_times(t), f"is no time in {self.unit}"),
            ("x", x, _no_pixels(x), "is no whole pixel from 0 on"),
            ("y", y, _no_pixels(y), "is no whole pixel from 0 on"),
            ("p", p, _no_polarities(p), "is none of 1 (ON), 0 and -1 (OFF)"),
        ):
            if not broken.any():
                continue
            damage.broken_events += int(np.count_nonzero(broken))
            if damage.broken_events > BROKEN_FREE + BROKEN_SHARE * (first_row + t.size):
                at = int(np.argmax(broken))
                raise RecordingError(
                    f"{name} = {column[at]} at event {first_row + at} {why}, and {damage.broken_events} values so far "
                    f"are broken: repair the columns: {self.path}"
                )
            t, x, y, p = (values[~broken] for values in (t, x, y, p))
            return self.columns(first_row, t, x, y, p, damage)
        return UncheckedEvents(microseconds(t, self.unit), _whole(x), _whole(y), p == 1)

    def _no_times(self, t: NDArray[Any]) -> NDArray[np.bool_]:
        last = LAST_US / UNITS_US[self.unit]
        good: NDArray[np.bool_] = NONE
        if t.dtype.kind == "f":
            good = np.abs(t.astype(np.float64)) < last  # not of NaN
        elif t.dtype.itemsize == 8 and t.size and (int(t.min()) <= -last or int(t.max()) >= last):
            good = (t > -last) & (t < last)
        return ~good


def _no_pixels(column: NDArray[Any]) -> NDArray[np.bool_]:
    good: NDArray[np.bool_] = NONE
    if column.dtype.kind == "f":
        good = (column >= 0) & (column < 2**31) & (column == np.floor(column))  # not of NaN
    elif column.dtype.kind == "i" and column.size and column.min() < 0:
        good = column >= 0
    return ~good


def _no_polarities(p: NDArray[Any]) -> NDArray[np.bool_]:
    good: NDArray[np.bool_] = NONE if p.dtype.kind == "b" else (p == 1) | (p == 0) | (p == -1)
    return ~good


def _whole(column: NDArray[Any]) -> NDArray[Any]:
    return column.astype(np.int64) if column.dtype.kind == "f" else column


def check_types(path: Path, types: dict[str, np.dtype[Any]]) -> None:
    """Raise RecordingError unless every column holds numbers."""
    for name, dtype in types.items():
        if dtype.kind not in "iufb" or (name in "txy" and dtype.kind == "b"):
            raise RecordingError(f"column {name} holds {dtype}, not numbers: export it as integers: {path}")
