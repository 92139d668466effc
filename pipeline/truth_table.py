"""Statements about all recordings of a folder: `truth.csv`, with a row for each recording."""

from __future__ import annotations

import difflib
import re
from contextlib import suppress
from pathlib import Path, PurePosixPath
from typing import Any

from .errors import ParameterError
from .text_table import table_rows

TRUTH_TABLE = "truth.csv"
# Columns and the tables of a sidecar to which they belong; any other field is a column `table.field`.
COLUMNS = {
    **dict.fromkeys(("spin_rps", "axis", "rps", "spin_std_rps", "axis_std_deg"), "truth"),
    **dict.fromkeys(("ball", "speed_m_s", "setting", "camera_frame", "dotted_shots", "dotted_trajectories"), "truth"),
    **dict.fromkeys(("x_px", "y_px", "radius_px"), "fixed_ball"),
}
TEXTS = ("setting", "dotted_shots", "camera_frame")  # fields that are no numbers, whatever they look like
MISSPELT = 0.8  # likeness (difflib) beyond which an unknown column is a known one misspelt: one or two letters off
_COMPONENT = re.compile(r"_([xyz])(?=_|$)")  # spin_x_rps and spin_rps_x are components of spin_rps, axis_x of axis


def truth_table_of(recording: Path) -> Path | None:
    """The `truth.csv` in a recording's folder or the one above; None without one."""
    there = (folder / TRUTH_TABLE for folder in recording.absolute().parents[:2])
    return next((path for path in there if path.is_file()), None)


def stated_tables(table: Path, recording: Path) -> dict[str, dict[str, Any]]:
    """Statements of a `truth.csv` on a recording, as the tables of a sidecar; empty without a row for it.

    The column `recording` holds a recording's path from the folder of the table, with or without its suffix. A vector
    is one cell with three numbers, or a column for each component. Empty cells state nothing, nor do columns of other
    names, unless they are nearly one of these.

    Raises
    ------
    RecordingError
        The file cannot be read, is no text or too large.
    ParameterError
        It has no column `recording`, a column is misspelt, or a recording has two rows.
    """
    path = recording.absolute().relative_to(table.absolute().parent)
    names = {path.as_posix(), path.with_suffix("").as_posix()}
    rows = [row for row in _rows(table) if PurePosixPath(row["recording"].replace("\\", "/")).as_posix() in names]
    if len(rows) > 1:
        raise ParameterError(f"two rows are of {path.as_posix()}: leave one of them: {table}")
    return _tables(rows[0], table) if rows else {}


def _rows(table: Path) -> list[dict[str, str]]:
    """The rows by column; raises as `table_rows` does, and ParameterError without the column `recording`."""
    columns, rows = table_rows(table)
    if "recording" not in columns:
        raise ParameterError(f"the table has no column `recording`, but {', '.join(columns) or 'nothing'}: {table}")
    return [{"recording": ""} | row for row in rows]


def _tables(row: dict[str, str], table: Path) -> dict[str, dict[str, Any]]:
    """The row's values by the sidecar's table and field."""
    tables: dict[str, dict[str, Any]] = {}
    for column, text in row.items():
        name = _COMPONENT.sub("", column)
        group, _, field = name.rpartition(".")
        group = group or ("biases" if name.startswith("bias_") else COLUMNS.get(name, ""))
        if not group:
            if close := difflib.get_close_matches(column, COLUMNS, n=1, cutoff=MISSPELT):
                raise ParameterError(f"column {column} is unknown: did you mean {close[0]}? {table}")
        elif text and name != column:
            tables.setdefault(group, {}).setdefault(field, []).append(_value(text))
        elif text:
            tables.setdefault(group, {})[field] = text if field in TEXTS else _value(text)
    return tables


def _value(text: str) -> Any:
    """A whole number, a number, several of them (between brackets or not), or the text itself."""
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    try:
        return [float(number) for number in text.strip("[]() ").replace(",", " ").split()]
    except ValueError:
        return text
