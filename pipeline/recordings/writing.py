"""Writing recordings, so that a full disk or a crash never leaves half a file; RAW in `raw_writing.py`."""

from __future__ import annotations

import os
import secrets
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from io import BytesIO, FileIO
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np
from numpy.lib import format as npy

from ..errors import RecordingError
from ..events import EventBatch
from ..results import Truth
from .sensor import MAX_SIZE_PX
from .source import Triggers

HDF5_CHUNK_EVENTS = 1 << 15  # 256 kB of times: fits the 1 MB cache of HDF5, and a window reads little more
COPY_BYTES = 1 << 20
# What the system, h5py and zipfile throw when the disk is full or the place is no good.
WRITE_ERRORS = (OSError, RuntimeError, ValueError, MemoryError)
SENSOR_KEYS = ("width", "height", "geometry")
COLUMN_TYPES: dict[str, np.dtype[Any]] = {
    "t": np.dtype("<i8"),
    "x": np.dtype("<u2"),
    "y": np.dtype("<u2"),
    "p": np.dtype("u1"),
}
ZIP_LEVEL = 1  # 7 times faster than the default level, for 4 % more bytes
Batches = EventBatch | Iterable[EventBatch]


def write_recording(
    path: str | Path,
    events: Batches,
    *,
    width_px: int,
    height_px: int,
    attributes: Mapping[str, str | float] | None = None,
    truth: Truth | None = None,
    triggers: Triggers | None = None,
    t_offset_us: int | None = None,
) -> None:
    """Write Spinscope's own HDF5: columns with gzip, root attributes, /truth.

    events : one batch, or batches in order of time, written as they come
    truth : label must have one value an event
    triggers : goes to /EXT_TRIGGER/events, as in Prophesee's files

    The file appears under its name only when complete. Raises RecordingError when it cannot be written, or
    for events outside the sensor or out of order.
    """
    with Hdf5Writer.open(path, width_px, height_px) as writer:
        for batch in batches_of(events):
            writer.append(batch)
        writer.finish(attributes or {}, truth, triggers, t_offset_us)


def write_npz(path: str | Path, events: Batches, *, width_px: int | None = None, height_px: int | None = None) -> None:
    """Write NPZ with columns t (int64, us), x, y (uint16), p (uint8), and scalars `width`, `height` if given.

    The file appears under its name only when complete. Raises RecordingError when it cannot be written.
    """
    with complete_file(path) as part, ExitStack() as stack:
        # The length of an array stands before it: columns wait in unnamed files until all events have come.
        columns = {c: stack.enter_context(tempfile.TemporaryFile(dir=part.parent)) for c in COLUMN_TYPES}
        checked = CheckedEvents(path, width_px or MAX_SIZE_PX, height_px or MAX_SIZE_PX)
        for batch in batches_of(events):
            checked.add(batch)
            for name, values in _columns(batch).items():
                columns[name].write(values.tobytes())
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED, compresslevel=ZIP_LEVEL) as archive:
            for name, dtype in COLUMN_TYPES.items():
                columns[name].seek(0)
                _write_array(archive, name, dtype, (checked.events,), columns[name])
            if width_px is not None and height_px is not None:
                for name, size in (("width", width_px), ("height", height_px)):
                    _write_array(archive, name, np.dtype("<u2"), (), BytesIO(np.uint16(size).tobytes()))


def write_raw(
    path: str | Path,
    events: Batches,
    *,
    width_px: int,
    height_px: int,
    format: str = "EVT3",
    attributes: Mapping[str, str | float] | None = None,
    triggers: Triggers | None = None,
) -> None:
    """Write Prophesee RAW (format EVT3 or EVT2), with triggers among the events.

    The file appears under its name only when complete. Raises RecordingError when it cannot be written, for
    pixels above 2047 and for times before 0 or beyond 2^40 us (EVT3: 12 days) or 2^52 us (EVT2: 142 years).
    """
    from .raw_writing import RawWriter  # brings compiled encoders: 0.9 s to load

    with RawWriter.open(path, width_px, height_px, format, attributes or {}, triggers) as writer:
        for batch in batches_of(events):
            writer.append(batch)


class Hdf5Writer:
    """An HDF5 recording that grows batch by batch; see `write_recording`."""

    def __init__(
        self, file: h5py.File, disk: FileThatHoldsErrors, path: str | Path, width_px: int, height_px: int
    ) -> None:
        self._file, self._disk, self._path = file, disk, path
        self._checked = CheckedEvents(path, width_px, height_px)
        file.attrs["width"], file.attrs["height"] = width_px, height_px
        self._columns = {
            name: file.create_dataset(
                f"events/{name}",
                (0,),
                dtype,
                maxshape=(None,),
                chunks=(HDF5_CHUNK_EVENTS,),
                shuffle=True,  # a quarter smaller
                compression="gzip",
            )
            for name, dtype in COLUMN_TYPES.items()
        }

    @classmethod
    @contextmanager
    def open(cls, path: str | Path, width_px: int, height_px: int) -> Iterator[Hdf5Writer]:
        """A writer; the file is complete and in place when the context ends without an error."""
        with complete_file(path) as part, FileThatHoldsErrors(part, "x+") as disk:
            with h5py.File(disk, "w") as file:
                yield cls(file, disk, path, width_px, height_px)
            disk.raise_error()

    def append(self, batch: EventBatch) -> None:
        """Add events that follow those before."""
        first = self._checked.events
        self._checked.add(batch)
        for name, values in _columns(batch).items():
            self._columns[name].resize((first + len(batch),))
            self._columns[name][first:] = values
        self._disk.raise_error()

    def finish(
        self,
        attributes: Mapping[str, str | float],
        truth: Truth | None = None,
        triggers: Triggers | None = None,
        t_offset_us: int | None = None,
    ) -> None:
        """Add what goes with the events."""
        for name, value in attributes.items():
            if name not in SENSOR_KEYS:
                self._file.attrs[name] = value.replace("\0", "") if isinstance(value, str) else value
        if truth is not None:
            self._write_truth(truth)
        if triggers is not None and len(triggers):
            records = np.zeros(len(triggers), [("p", "<i2"), ("t", "<i8"), ("id", "<i2")])
            records["p"], records["t"], records["id"] = triggers.value, triggers.t_us, triggers.id
            self._file.create_dataset("EXT_TRIGGER/events", data=records)
        if t_offset_us is not None:
            self._file.create_dataset("t_offset", data=np.int64(t_offset_us))

    def _write_truth(self, truth: Truth) -> None:
        if truth.label.shape != (self._checked.events,):
            raise RecordingError(
                f"truth has {truth.label.size} labels for {self._checked.events} events: one an event is "
                f"needed: {self._path}"
            )
        for name in Truth.__slots__:
            values = getattr(truth, name)
            self._file.create_dataset(f"truth/{name}", data=values, compression="gzip" if values.size else None)


class FileThatHoldsErrors(FileIO):
    """A file for HDF5 whose writes never fail: the first error is kept for `raise_error`.

    HDF5 leaves its objects half closed when a write fails, and the process crashes on letting go of them.
    """

    error: OSError | None = None

    def write(self, data: Any) -> int:
        """Write all of it, or keep the error; returns the number of bytes, as if they were written."""
        rest = memoryview(data).cast("B")
        size = len(rest)
        while len(rest) and self.error is None:
            try:
                rest = rest[super().write(rest) :]
            except OSError as error:
                self.error = error
        return size

    def truncate(self, size: int | None = None) -> int:
        """Set the length of the file, or keep the error."""
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0

    def raise_error(self) -> None:
        """Raise the first error there was."""
        if self.error is not None:
            raise self.error


class CheckedEvents:
    """Counts events on their way out and refuses those that no reader would take back."""

    def __init__(self, path: str | Path, width_px: int, height_px: int) -> None:
        self._path, self._width_px, self._height_px = path, width_px, height_px
        if not (0 < width_px <= MAX_SIZE_PX and 0 < height_px <= MAX_SIZE_PX):
            raise RecordingError(f"sensor of {width_px} x {height_px} px: 1 to {MAX_SIZE_PX} are allowed: {path}")
        self.events = 0
        self._last_us = -(2**63)

    def add(self, batch: EventBatch) -> None:
        """Take note of the next events."""
        if not len(batch):
            return
        if int(batch.x_px.max()) >= self._width_px or int(batch.y_px.max()) >= self._height_px:
            raise RecordingError(
                f"events reach over {int(batch.x_px.max()) + 1} x {int(batch.y_px.max()) + 1} pixels, more "
                f"than the sensor's {self._width_px} x {self._height_px}: state a larger sensor: {self._path}"
            )
        if int(batch.t_us[0]) < self._last_us or np.any(batch.t_us[1:] < batch.t_us[:-1]):
            raise RecordingError(f"events to be written are not in order of time: sort them: {self._path}")
        self.events += len(batch)
        self._last_us = int(batch.t_us[-1])


@contextmanager
def complete_file(path: str | Path) -> Iterator[Path]:
    """A name beside `path` to write to; takes its place when the context ends, is removed on any error."""
    target = Path(os.path.realpath(path))
    if target.is_dir() or not target.parent.is_dir():
        why = "it is a folder" if target.is_dir() else "its folder does not exist"
        raise RecordingError(f"recording cannot be written, {why}: give another name: {path}")
    part = target.with_name(f".{target.name[:200]}.{secrets.token_hex(4)}.part")
    try:
        yield part
        os.replace(part, target)
    except WRITE_ERRORS as error:
        why = getattr(error, "strerror", None) or " ".join(str(error).split())[:200]
        raise RecordingError(f"recording cannot be written ({why}): check free space and rights: {path}") from error
    finally:
        part.unlink(missing_ok=True)


def batches_of(events: Batches) -> Iterable[EventBatch]:
    """One batch as a list of one, several as they are."""
    return [events] if isinstance(events, EventBatch) else events


def _columns(batch: EventBatch) -> dict[str, Any]:
    return {"t": batch.t_us, "x": batch.x_px, "y": batch.y_px, "p": batch.on.view(np.uint8)}


def _write_array(
    archive: zipfile.ZipFile, name: str, dtype: np.dtype[Any], shape: tuple[int, ...], values: IO[bytes]
) -> None:
    with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
        npy.write_array_header_1_0(file, {"descr": dtype.str, "fortran_order": False, "shape": shape})
        while block := values.read(COPY_BYTES):
            file.write(block)
