"""Arrays in NumPy's files, described by their headers and read in blocks of rows without unpacking them whole."""

from __future__ import annotations

import tokenize
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ..errors import RecordingError

Opener = Callable[[str], IO[bytes]]  # opens the file of an array, given its name


@dataclass(frozen=True, slots=True)
class NpyArray:
    """Header of one array.

    Attributes
    ----------
    name : str
        Name for `Opener`.
    shape, dtype, fortran
        As the header states them; `fortran` is the order in which a table's columns stand behind each other.
    header_bytes, stored_bytes, packed_bytes : int
        Length of the header; of header and numbers as they are in the file, unpacked and packed.
    """

    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    fortran: bool
    header_bytes: int
    stored_bytes: int
    packed_bytes: int

    @classmethod
    def read(cls, open_array: Opener, name: str, stored_bytes: int, packed_bytes: int, path: Path) -> NpyArray:
        """Read the header of an array; raises RecordingError for one that is none."""
        with open_array(name) as file:
            try:
                version = npy.read_magic(file)
                header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
                shape, fortran, dtype = header(file)
            except (SyntaxError, tokenize.TokenError) as error:  # of Python's parser, which NumPy asks
                raise RecordingError(f"header of array {name} is damaged: copy the file again: {path}") from error
            return cls(name, shape, dtype, bool(fortran), file.tell(), stored_bytes, packed_bytes)

    @property
    def unpacked_bytes(self) -> int:
        """Length of the numbers as the header states it."""
        return int(np.prod(self.shape, dtype=object)) * self.dtype.itemsize

    def check(self, path: Path) -> None:
        """Raise RecordingError when the array holds Python objects or is not as long as its header says."""
        if self.dtype.hasobject:
            raise RecordingError(
                f"array {self.name} holds Python objects, which can run code when opened: "
                f"save it as numbers (np.savez): {path}"
            )
        if self.header_bytes + self.unpacked_bytes != self.stored_bytes:
            raise RecordingError(
                f"array {self.name} has {self.stored_bytes - self.header_bytes} bytes, not the "
                f"{self.unpacked_bytes} its header states: export the recording again: {path}"
            )

    @property
    def rows(self) -> int | None:
        """Number of rows of a column (n, n x 1, 1 x n) or a table (n x k, k x n); None for what is neither.

        A table is wider than it is long only with its k <= 4 columns as rows.
        """
        if len(self.shape) == 1:
            return self.shape[0]
        return max(self.shape) if len(self.shape) == 2 and min(self.shape) <= 4 else None

    @property
    def width(self) -> int:
        """Number of columns of a table, 1 for a column."""
        return min(self.shape) if len(self.shape) == 2 else 1

    def column(self, part: str | int) -> ArrayColumn:
        """Place of a field of its records, or of column `part` of the table."""
        if isinstance(part, str):
            assert self.dtype.fields is not None
            dtype, offset = self.dtype.fields[part][:2]
            return ArrayColumn(ArrayRows(self.name, self.header_bytes, self.dtype.itemsize), dtype, offset)
        item, rows = self.dtype.itemsize, self.rows or 0
        # Whether the numbers of a column follow each other in the file.
        if self.fortran == (self.shape[0] == rows):
            return ArrayColumn(ArrayRows(self.name, self.header_bytes + part * rows * item, item), self.dtype, 0)
        return ArrayColumn(ArrayRows(self.name, self.header_bytes, self.width * item), self.dtype, part * item)


class ArrayRows(NamedTuple):
    """Rows of an array: its name, the place of the first row in its file, bytes from row to row."""

    name: str
    start: int
    row_bytes: int


class ArrayColumn(NamedTuple):
    """Column in the rows of an array, at `offset` bytes in each."""

    rows: ArrayRows
    dtype: np.dtype[Any]
    offset: int


def column_blocks(
    open_array: Opener, columns: Mapping[str, ArrayColumn], rows: int, most: int
) -> Iterator[dict[str, NDArray[Any]]]:
    """Yield the columns in blocks of `most` rows or fewer; columns that share their rows are read once."""
    with ExitStack() as stack:
        files = {column.rows: stack.enter_context(open_array(column.rows.name)) for column in columns.values()}
        for place, file in files.items():
            file.seek(place.start)
        for row in range(0, rows, most):
            count = min(most, rows - row)
            blocks = {place: file.read(count * place.row_bytes) for place, file in files.items()}
            yield {c: _column_in(blocks[column.rows], column) for c, column in columns.items()}


def _column_in(block: bytes, column: ArrayColumn) -> NDArray[Any]:
    step = column.rows.row_bytes
    return np.ndarray((len(block) // step,), column.dtype, block, column.offset, (step,))
