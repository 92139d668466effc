"""Tables of the user in CSV, as people and spreadsheets write them."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import RecordingError

Floats = NDArray[np.float64]

LARGEST_BYTES = 8 << 20  # tens of thousands of rows


def table_rows(table: Path) -> tuple[list[str], list[dict[str, str]]]:
    """Names of the columns, and the rows by column, without spaces around names and values.

    The delimiter is a comma, a semicolon (with decimal commas) or a tab, whichever the first line holds most of.

    Raises
    ------
    RecordingError
        The file cannot be read, is no text or too large.
    """
    lines = _lines(table)
    columns = [name.strip() for name in lines[0]] if lines else []
    return columns, [dict(zip(columns, map(str.strip, line), strict=False)) for line in lines[1:]]


def number_rows(table: Path) -> Floats:
    """(n, m) float64 numbers of a table without names of columns; (0,) where a cell is no number, or a row shorter.

    Raises as `table_rows` does.
    """
    try:
        rows = np.array([[float(cell) for cell in line] for line in _lines(table) if line], np.float64)
    except ValueError:
        return np.empty(0)
    return rows if np.isfinite(rows).all() else np.empty(0)


def _lines(table: Path) -> list[list[str]]:
    """Cells of each line; raises as `table_rows` does."""
    try:
        with open(table, "rb") as file:
            content = file.read(LARGEST_BYTES + 1)
        text = content.decode("utf-8-sig")
    except OSError as error:
        raise RecordingError(f"the table cannot be read ({error.strerror}): {table}") from error
    except ValueError:
        raise RecordingError(f"the table is no UTF-8 text: {table}") from None
    if len(content) > LARGEST_BYTES:
        raise RecordingError(f"the table is larger than {LARGEST_BYTES >> 20} MB: {table}")
    heading = text.partition("\n")[0]
    delimiter = max(",;\t", key=heading.count)
    if delimiter == ";":  # as spreadsheets write it where the comma is the decimal point
        text = text.replace(",", ".")
    try:
        return list(csv.reader(io.StringIO(text), delimiter=delimiter, skipinitialspace=True))
    except csv.Error as error:
        raise RecordingError(f"the table is no CSV ({error}): {table}") from None
