"""Writer of Spinscope's own HDF5 layout: columns with gzip, root attributes, /truth."""

from __future__ import annotations

from io import FileIO
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ....errors import RecordingError
from ....results import Truth
from ...column_types import COLUMN_TYPES, columns_of
from ..registry import RecordingContent

# 256 kB of times fit the 1 MB cache of HDF5, and a window reads little more; shuffling makes them a quarter smaller.
STORAGE: dict[str, Any] = {"chunks": (1 << 15,), "shuffle": True, "compression": "gzip"}


def write_hdf5(path: Path, content: RecordingContent) -> None:
    """Write a new file; triggers go to /EXT_TRIGGER/events, as in Prophesee's files."""
    with ErrorHoldingFile(path, "x+") as disk:
        with h5py.File(disk, "w") as file:
            file.attrs["width"], file.attrs["height"] = content.width_px, content.height_px
            # Kept open to the end: datasets closed earlier would be laid out differently in the file.
            columns = {
                name: file.create_dataset(f"events/{name}", (0,), dtype, maxshape=(None,), **STORAGE)
                for name, dtype in COLUMN_TYPES.items()
            }
            events = 0
            for batch in content.batches:
                for name, values in columns_of(batch).items():
                    columns[name].resize((events + len(batch),))
                    columns[name][events:] = values
                events += len(batch)
                disk.raise_error()
            for name, value in content.attributes.items():
                file.attrs[name] = value.replace("\0", "") if isinstance(value, str) else value
            truth = content.truth()
            if truth is not None:
                _write_truth(file, truth, events, content.path)
            triggers = content.triggers()
            if len(triggers):
                records = np.zeros(len(triggers), [("p", "<i2"), ("t", "<i8"), ("id", "<i2")])
                records["p"], records["t"], records["id"] = triggers.value, triggers.t_us, triggers.id
                file.create_dataset("EXT_TRIGGER/events", data=records)
            if content.t_offset_us is not None:
                file.create_dataset("t_offset", data=np.int64(content.t_offset_us))
        disk.raise_error()


def _write_truth(file: h5py.File, truth: Truth, events: int, path: Path) -> None:
    if truth.label.shape != (events,):
        raise RecordingError(f"truth has {truth.label.size} labels for {events} events: one an event is needed: {path}")
    for name in Truth.__slots__:
        values = getattr(truth, name)
        file.create_dataset(f"truth/{name}", data=values, compression="gzip" if values.size else None)


class ErrorHoldingFile(FileIO):
    """File for HDF5 whose writes never fail: the first error is kept for `raise_error`.

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
