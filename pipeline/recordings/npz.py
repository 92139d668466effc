"""Reading NPZ files: arrays of numbers in a zip, streamed without unpacking them whole."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ..errors import RecordingError
from ..results import Truth
from .columns import ColumnTypes, named_columns, refuse_bomb, refuse_types
from .sensor import Sensor, stated_or_none
from .source import MAX_DISORDER_US, Columns, Pass, translated

SNIFFED_ROWS = 1 << 16  # times looked at to tell seconds from microseconds


class NpzSource:
    """One NPZ recording: one array a column, or one array of records."""

    format = "NPZ"
    order_is_law = True

    def __init__(self, path: Path) -> None:
        self.path = path
        self.warnings: list[str] = []
        self.attributes: dict[str, str | float] = {}
        with translated(path, "NPZ"), zipfile.ZipFile(path) as archive:
            arrays = {name: Array(archive, name, path) for name in _array_names(archive)}
            self._members, self._fields = _chosen(arrays, path)
            used = [arrays[member] for member in dict.fromkeys(self._members.values())]
            if len({array.shape for array in used}) > 1 or any(len(array.shape) != 1 for array in used):
                listed = ", ".join(f"{c} {arrays[m].shape}" for c, m in self._members.items())
                raise RecordingError(f"event columns differ in length ({listed}): export them again: {path}")
            for array in used:
                array.refuse_incomplete(path)
            refuse_bomb(sum(a.packed_bytes for a in used), sum(a.unpacked_bytes for a in used), path)
            self.events: int | None = used[0].shape[0]
            types = {c: arrays[m].dtype for c, m in self._members.items()}
            if self._fields:
                types = {c: types[c][name] for c, name in self._fields.items()}
            refuse_types(path, types)
            self.stated = _stated_sensor(archive, arrays, self.warnings)
            self.t_offset_us = _scalar(archive, arrays, "t_offset")
            with Columnwise(archive, self._members, self._fields) as reader:
                first_times = reader.next_rows(min(self.events, SNIFFED_ROWS))[0]
        self._types = ColumnTypes(path, types["t"], first_times)
        if self._types.warning:
            self.warnings.append(self._types.warning)

    def columns(self, reading: Pass) -> Iterator[Columns]:
        """The events; packed columns can only be read from their start."""
        rows = self.events or 0
        with (
            translated(self.path, "NPZ"),
            zipfile.ZipFile(self.path) as archive,
            Columnwise(archive, self._members, self._fields) as reader,
        ):
            for row in range(0, rows, reading.max_events):
                upto = min(row + reading.max_events, rows)
                block = self._types.columns(row, *reader.next_rows(upto - row))
                yield block
                reading.report(upto, rows)
                if reading.end_us is not None and int(block.t_us[-1]) >= reading.end_us + MAX_DISORDER_US:
                    return

    def truth(self) -> Truth | None:
        """NPZ files hold none."""
        return None


class Array:
    """What the header of one array in the archive says."""

    def __init__(self, archive: zipfile.ZipFile, name: str, path: Path) -> None:
        info = archive.getinfo(f"{name}.npy")
        with archive.open(info) as file:
            self.shape, _, self.dtype = _npy_header(file)
            self._header_bytes = file.tell()
        self.name, self.packed_bytes, self._stored_bytes = name, info.compress_size, info.file_size
        if self.dtype.hasobject:
            raise RecordingError(
                f"array {name} holds Python objects, which can run code when opened: "
                f"save it as numbers (np.savez): {path}"
            )
        self.unpacked_bytes = int(np.prod(self.shape, dtype=object)) * self.dtype.itemsize

    def refuse_incomplete(self, path: Path) -> None:
        """Raise RecordingError when the array is not as long as its header says."""
        if self._header_bytes + self.unpacked_bytes != self._stored_bytes:
            raise RecordingError(
                f"array {self.name} has {self._stored_bytes - self._header_bytes} bytes, not the "
                f"{self.unpacked_bytes} its header states: export the recording again: {path}"
            )


class Columnwise:
    """Reads t, x, y and p in step, each from its own place in the archive."""

    def __init__(self, archive: zipfile.ZipFile, members: dict[str, str], fields: dict[str, str]) -> None:
        self._archive, self._members, self._fields = archive, members, fields
        self._open = ExitStack()
        self._files: dict[str, tuple[IO[bytes], np.dtype[Any]]] = {}

    def __enter__(self) -> Columnwise:
        for member in dict.fromkeys(self._members.values()):
            file = self._open.enter_context(self._archive.open(f"{member}.npy"))
            self._files[member] = (file, _npy_header(file)[2])
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def next_rows(self, count: int) -> tuple[NDArray[Any], ...]:
        """t, x, y and p of the next rows."""
        blocks = {
            member: np.frombuffer(file.read(count * dtype.itemsize), dtype, count)
            for member, (file, dtype) in self._files.items()
        }
        if self._fields:
            return tuple(np.ascontiguousarray(blocks[self._members[c]][self._fields[c]]) for c in "txyp")
        return tuple(blocks[self._members[c]] for c in "txyp")


def _array_names(archive: zipfile.ZipFile) -> list[str]:
    return [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]


def _npy_header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    version = npy.read_magic(file)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, fortran, dtype = read(file)
    return shape, fortran, dtype


def _chosen(arrays: dict[str, Array], path: Path) -> tuple[dict[str, str], dict[str, str]]:
    """Array of each column and, for an array of records, the field of each column."""
    names = named_columns(arrays)
    if names is not None:
        return names, {}
    for name, array in arrays.items():
        fields = named_columns(array.dtype.names or ())
        if fields is not None:
            return dict.fromkeys("txyp", name), fields
    present = ", ".join(list(arrays)[:8]) or "no arrays"
    raise RecordingError(f"NPZ file holds no events (it has {present}): arrays t, x, y, p are needed: {path}")


def _stated_sensor(archive: zipfile.ZipFile, arrays: dict[str, Array], warnings: list[str]) -> Sensor | None:
    width, height = (_scalar(archive, arrays, name) for name in ("width", "height"))
    return None if width is None or height is None else stated_or_none(width, height, warnings)


def _scalar(archive: zipfile.ZipFile, arrays: dict[str, Array], name: str) -> int | None:
    array = arrays.get(name)
    if array is None or array.dtype.kind not in "iu" or array.unpacked_bytes != array.dtype.itemsize:
        return None
    with archive.open(f"{name}.npy") as file:
        dtype = _npy_header(file)[2]
        return int(np.frombuffer(file.read(dtype.itemsize), dtype, 1)[0])
