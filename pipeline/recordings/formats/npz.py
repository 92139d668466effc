"""NPZ: arrays of numbers in a zip archive, streamed without unpacking them whole."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ...errors import RecordingError
from ..column_types import COLUMN_TYPES, ColumnTypes, check_expansion, check_types, columns_of, named_columns
from ..reader import FormatReader, ReadPass, UncheckedEvents, file_errors
from ..sensor import resolution_or_none
from .registry import FORMATS, RecordingContent, RecordingFormat

SAMPLED_ROWS = 1 << 16  # times looked at to tell seconds from microseconds
COPY_BYTES = 1 << 20
ZIP_LEVEL = 1  # 7 times faster than the default level, for 4 % more bytes


class NpzReader(FormatReader):
    """Reader of one NPZ recording: one array a column, or one array of records."""

    format = "NPZ"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with file_errors(path, "NPZ"), zipfile.ZipFile(path) as archive:
            names = [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]
            arrays = {name: NpzArray(archive, name, path) for name in names}
            self._members, self._fields = _chosen(arrays, path)
            used = [arrays[member] for member in dict.fromkeys(self._members.values())]
            if len({array.shape for array in used}) > 1 or any(len(array.shape) != 1 for array in used):
                listed = ", ".join(f"{c} {arrays[m].shape}" for c, m in self._members.items())
                raise RecordingError(f"event columns differ in length ({listed}): export them again: {path}")
            for array in used:
                array.check_length(path)
            check_expansion(sum(a.packed_bytes for a in used), sum(a.unpacked_bytes for a in used), path)
            self.events = used[0].shape[0]
            types = {c: arrays[m].dtype for c, m in self._members.items()}
            if self._fields:
                types = {c: types[c][name] for c, name in self._fields.items()}
            check_types(path, types)
            width, height, self.t_offset_us = (_scalar(archive, arrays, n) for n in ("width", "height", "t_offset"))
            if width is not None and height is not None:
                self.stated = resolution_or_none(width, height, self.warnings)
            blocks = _blocks(archive, self._members, self._fields, self.events, SAMPLED_ROWS)
            first_times = next(blocks, (np.empty(0, types["t"]),))[0]
        self._types = ColumnTypes(path, first_times)
        if self._types.warning:
            self.warnings.append(self._types.warning)

    def columns(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield the events; packed columns can only be read from their start."""
        rows, row = self.events or 0, 0
        with file_errors(self.path, "NPZ"), zipfile.ZipFile(self.path) as archive:
            for columns in _blocks(archive, self._members, self._fields, rows, reading.max_events):
                block = self._types.columns(row, *columns)
                yield block
                row += len(block)
                reading.report(row, rows)
                if reading.is_past(int(block.t_us[-1])):
                    return


class NpzArray:
    """Header of one array in the archive."""

    def __init__(self, archive: zipfile.ZipFile, name: str, path: Path) -> None:
        info = archive.getinfo(f"{name}.npy")
        with archive.open(info) as file:
            self.shape, self.dtype = _npy_header(file)
            self._header_bytes = file.tell()
        self.name, self.packed_bytes, self._stored_bytes = name, info.compress_size, info.file_size
        if self.dtype.hasobject:
            raise RecordingError(
                f"array {name} holds Python objects, which can run code when opened: "
                f"save it as numbers (np.savez): {path}"
            )
        self.unpacked_bytes = int(np.prod(self.shape, dtype=object)) * self.dtype.itemsize

    def check_length(self, path: Path) -> None:
        """Raise RecordingError when the array is not as long as its header says."""
        if self._header_bytes + self.unpacked_bytes != self._stored_bytes:
            raise RecordingError(
                f"array {self.name} has {self._stored_bytes - self._header_bytes} bytes, not the "
                f"{self.unpacked_bytes} its header states: export the recording again: {path}"
            )


def _blocks(
    archive: zipfile.ZipFile, members: dict[str, str], fields: dict[str, str], rows: int, most: int
) -> Iterator[tuple[NDArray[Any], ...]]:
    """Yield t, x, y and p in blocks of `most` rows or fewer, each array read from its own place in the archive."""
    with ExitStack() as stack:
        files = {name: stack.enter_context(archive.open(f"{name}.npy")) for name in set(members.values())}
        types = {name: _npy_header(file)[1] for name, file in files.items()}
        for row in range(0, rows, most):
            count = min(most, rows - row)
            blocks = {n: np.frombuffer(f.read(count * types[n].itemsize), types[n], count) for n, f in files.items()}
            if fields:
                yield tuple(np.ascontiguousarray(blocks[members[c]][fields[c]]) for c in "txyp")
            else:
                yield tuple(blocks[members[c]] for c in "txyp")


def _npy_header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    read = npy.read_array_header_1_0 if npy.read_magic(file) == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read(file)
    return shape, dtype


def _chosen(arrays: dict[str, NpzArray], path: Path) -> tuple[dict[str, str], dict[str, str]]:
    """Choose the array of each column and, for an array of records, the field of each column."""
    names = named_columns(arrays)
    if names is not None:
        return names, {}
    for name, array in arrays.items():
        fields = named_columns(array.dtype.names or ())
        if fields is not None:
            return dict.fromkeys("txyp", name), fields
    present = ", ".join(list(arrays)[:8]) or "no arrays"
    raise RecordingError(f"NPZ file holds no events (it has {present}): arrays t, x, y, p are needed: {path}")


def _scalar(archive: zipfile.ZipFile, arrays: dict[str, NpzArray], name: str) -> int | None:
    array = arrays.get(name)
    if array is None or array.dtype.kind not in "iu" or array.unpacked_bytes != array.dtype.itemsize:
        return None
    with archive.open(f"{name}.npy") as file:
        dtype = _npy_header(file)[1]
        return int(np.frombuffer(file.read(dtype.itemsize), dtype, 1)[0])


def write_npz(path: Path, content: RecordingContent) -> None:
    """Write the columns t (int64, us), x, y (uint16), p (uint8), and the scalars `width` and `height`."""
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
            for name, size in (("width", content.width_px), ("height", content.height_px)):
                _write_array(archive, name, np.dtype("<u2"), (), BytesIO(np.uint16(size).tobytes()))


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
        sniff=lambda path, head: head.startswith(b"PK"),
        open=NpzReader,
        write=write_npz,
        isolated=True,
    )
)
