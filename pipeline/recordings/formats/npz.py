"""NumPy's files, NPZ and NPY: columns, records or n x 4 tables, streamed without unpacking them whole."""

from __future__ import annotations

import tempfile
import zipfile
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from io import BytesIO
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from ...errors import RecordingError
from ..column_types import (
    COLUMN_TYPES,
    ColumnTypes,
    check_expansion,
    check_types,
    column_order,
    columns_of,
    named_columns,
)
from ..numpy_arrays import ArrayColumn, NpyArray, Opener, column_blocks
from ..reader import FILE_ERRORS, FormatReader, ReadingOptions, ReadPass, UncheckedEvents, file_errors
from ..sensor import resolution_or_none
from ..time_units import split_unit, unit_of
from .registry import FORMATS, RecordingContent, RecordingFormat

SAMPLED_ROWS = 1 << 16  # looked at to tell units and columns apart
TEXT_BYTES = 1 << 16  # longest text of an attribute
COPY_BYTES = 1 << 20
ZIP_LEVEL = 1  # 7 times faster than the default level, for 4 % more bytes
TIME_UNIT_NAMES = ("time_unit", "unit", "units")
SIZE_NAMES = ("width", "height")

Columns = dict[str, ArrayColumn]


class NumpyReader(FormatReader):
    """Reader of events in NumPy arrays: one array a column, an array of records, or a table of four columns."""

    takes = ("dataset", "time_unit")

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        super().__init__(path, options)
        with file_errors(path, self.format), self._opened() as (open_array, arrays):
            values = {name: _scalar(open_array, array) for name, array in arrays.items()}
            stated = {name: value for name, value in values.items() if value is not None}
            if all(name in stated for name in SIZE_NAMES):
                self.stated = resolution_or_none(stated["width"], stated["height"], self.warnings)
            if isinstance(stated.get("t_offset"), int):
                self.t_offset_us = int(stated["t_offset"])
            self.attributes |= {n: value for n, value in stated.items() if n not in (*SIZE_NAMES, "t_offset")}
            self._columns, time_name = self._chosen(open_array, arrays)
            self.events = self._rows(arrays)
            check_types(path, {c: column.dtype for c, column in self._columns.items()})
            blocks = column_blocks(open_array, self._columns, self.events, SAMPLED_ROWS)
            times = next(blocks, {"t": np.empty(0, self._columns["t"].dtype)})["t"]
        unit = split_unit(time_name)[1] or next((unit_of(stated[n]) for n in TIME_UNIT_NAMES if n in stated), None)
        self._types = ColumnTypes(path, options, unit, times, times.size)
        self.warnings += self._types.warnings
        self.time_doubt = self._types.time_doubt

    @abstractmethod
    def _opened(self) -> AbstractContextManager[tuple[Opener, dict[str, NpyArray]]]:
        """Open the file: the way to open its arrays, and their headers by name."""

    def columns(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield the events; packed columns can only be read from their start."""
        rows, row = self.events or 0, 0
        with file_errors(self.path, self.format), self._opened() as (open_array, _):
            for columns in column_blocks(open_array, self._columns, rows, reading.max_events):
                block = self._types.columns(row, **columns, damage=reading.damage)
                row += columns["t"].size
                if len(block):
                    yield block
                reading.report(row, rows)
                if len(block) and reading.is_past(int(block.t_us[-1])):
                    return

    def _rows(self, arrays: Mapping[str, NpyArray]) -> int:
        """Number of events, after a check that the arrays in use are all there and of one length."""
        used = {column.rows.name: arrays[column.rows.name] for column in self._columns.values()}
        for array in used.values():
            array.check(self.path)
        rows = {array.rows for array in used.values()}
        if len(rows) > 1:
            listed = ", ".join(f"{c} {arrays[column.rows.name].shape}" for c, column in self._columns.items())
            raise RecordingError(f"event columns differ in length ({listed}): export them again: {self.path}")
        unpacked_bytes = sum(array.unpacked_bytes for array in used.values())
        check_expansion(sum(array.packed_bytes for array in used.values()), unpacked_bytes, self.path)
        return rows.pop() or 0

    def _chosen(self, open_array: Opener, arrays: Mapping[str, NpyArray]) -> tuple[Columns, str]:
        """Choose the place of each column; returns them, and the name of the times."""
        asked = self.options.dataset
        if asked is not None and asked not in arrays:
            raise RecordingError(f"--dataset {asked} is not in the file: give one of {', '.join(arrays)}: {self.path}")
        single: Columns = {}
        for name, array in arrays.items():
            if array.rows is not None and array.width == 1:
                single[name.removeprefix("dataset_")] = array.column(0)
            elif array.width == 2 and name.endswith("xy"):  # EVIMO2
                single |= {"x": array.column(0), "y": array.column(1)}
        names = named_columns(single) if asked is None else None
        if names is not None:
            return {c: single[name] for c, name in names.items()}, names["t"]
        found: dict[str, tuple[Columns, str]] = {}
        for name, array in arrays.items():
            places: dict[str, str] | dict[str, int] | None = named_columns(array.dtype.names or ())
            time_name = "" if places is None else str(places["t"])
            if places is None and asked in (None, name):
                places = self._order(open_array, array)
            if places is not None:
                found[name] = {c: array.column(part) for c, part in places.items()}, time_name
        if not found:
            present = ", ".join(list(arrays)[:8]) or "no arrays"
            raise RecordingError(
                f"{self.format} file holds no events (it has {present}): arrays t, x, y, p are needed, records with "
                f"these fields, or a table of four columns in order of time: {self.path}"
            )
        chosen = asked if asked in found else next(iter(found))
        if len(found) > 1 and asked is None:
            self.warnings.append(f"events are read from array {chosen} of {', '.join(found)}: --dataset NAME chooses")
        return found[chosen]

    def _order(self, open_array: Opener, array: NpyArray) -> dict[str, int] | None:
        """Columns of t, x, y and p in a table of four columns; None for all other arrays."""
        if array.width != 4 or not array.rows or array.dtype.kind not in "iuf":
            return None
        array.check(self.path)
        table = {str(k): array.column(k) for k in range(4)}
        sample = next(column_blocks(open_array, table, array.rows, SAMPLED_ROWS))
        return column_order(np.stack([sample[str(k)] for k in range(4)], axis=1))


class NpzReader(NumpyReader):
    """Reader of one NPZ recording."""

    format = "NPZ"

    @contextmanager
    def _opened(self) -> Iterator[tuple[Opener, dict[str, NpyArray]]]:
        with zipfile.ZipFile(self.path) as archive:

            def open_array(name: str) -> IO[bytes]:
                return archive.open(f"{name}.npy")

            arrays = {}
            for info in archive.infolist():
                if info.filename.endswith(".npy"):
                    name = info.filename.removesuffix(".npy")
                    arrays[name] = NpyArray.read(open_array, name, info.file_size, info.compress_size, self.path)
            yield open_array, arrays


class NpyReader(NumpyReader):
    """Reader of one NPY recording."""

    format = "NPY"

    @contextmanager
    def _opened(self) -> Iterator[tuple[Opener, dict[str, NpyArray]]]:
        def open_array(name: str) -> IO[bytes]:
            return open(self.path, "rb")

        size_bytes = self.path.stat().st_size
        name = self.path.stem
        yield open_array, {name: NpyArray.read(open_array, name, size_bytes, size_bytes, self.path)}


def _arrays_in(path: Path) -> list[str]:
    """Names of the arrays in a zip archive; those of a damaged one cannot be told, it counts as NPZ by its suffix."""
    try:
        with zipfile.ZipFile(path) as archive:
            return [name for name in archive.namelist() if name.endswith(".npy")]
    except FILE_ERRORS:
        return [path.name] if path.suffix.lower() == ".npz" else []


def _scalar(open_array: Opener, array: NpyArray) -> str | float | None:
    """Number or text of an array with one value; None for others."""
    if array.shape not in ((), (1,)) or array.dtype.kind not in "iufbU" or array.dtype.itemsize > TEXT_BYTES:
        return None
    with open_array(array.name) as file:
        file.seek(array.header_bytes)
        value = np.frombuffer(file.read(array.dtype.itemsize), array.dtype, 1)[0].item()
    return value if isinstance(value, (str, float, int)) else None


def write_npz(path: Path, content: RecordingContent) -> None:
    """Write the columns t (int64, us), x, y (uint16), p (uint8); as scalars the sensor's size and the attributes."""
    with ExitStack() as stack:
        # The length of an array stands before it: columns wait in unnamed files until all events have come.
        columns = {c: stack.enter_context(tempfile.TemporaryFile(dir=path.parent)) for c in COLUMN_TYPES}
        events = 0
        for batch in content.batches:
            events += len(batch)
            for name, values in columns_of(batch).items():
                columns[name].write(values.tobytes())
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=ZIP_LEVEL) as archive:
            for name, dtype in COLUMN_TYPES.items():
                columns[name].seek(0)
                _write_array(archive, name, dtype, (events,), columns[name])
            size_px = {"width": np.uint16(content.width_px), "height": np.uint16(content.height_px)}
            for name, value in {**content.attributes, **size_px}.items():
                scalar = np.array(value)
                _write_array(archive, name, scalar.dtype, (), BytesIO(scalar.tobytes()))


def _write_array(
    archive: zipfile.ZipFile, name: str, dtype: np.dtype[Any], shape: tuple[int, ...], values: IO[bytes]
) -> None:
    with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
        npy.write_array_header_1_0(file, {"descr": dtype.str, "fortran_order": False, "shape": shape})
        while block := values.read(COPY_BYTES):
            file.write(block)


FORMATS.register(
    RecordingFormat(
        name="npz",
        label="NPZ",
        suffixes=(".npz",),
        sniff=lambda path, head: head.startswith(b"PK") and bool(_arrays_in(path)),
        open=NpzReader,
        write=write_npz,
        isolated=True,
        keeps=frozenset({"sensor", "attributes"}),
    )
)
FORMATS.register(
    RecordingFormat(
        name="npy",
        label="NPY",
        suffixes=(".npy",),
        sniff=lambda path, head: head.startswith(npy.MAGIC_PREFIX),
        open=NpyReader,
        isolated=True,
    )
)
