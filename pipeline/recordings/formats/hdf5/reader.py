"""Reader of HDF5 recordings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ....errors import RecordingError
from ....isolation import without_time_limit
from ....results import Truth
from ...column_types import ColumnTypes, check_expansion, check_types, column_order
from ...reader import (
    FormatReader,
    Place,
    ReadingOptions,
    ReadPass,
    Triggers,
    UncheckedEvents,
    file_errors,
)
from ...sensor import Resolution, geometry_or_none, resolution_or_none
from ...time_units import split_unit, unit_of
from .layout import TABLE_COLUMNS, ColumnPlace, EventLayout, find_layout
from .storage import own_dataset

if TYPE_CHECKING:
    from .ecf import EcfRows

ECF_FILTER = 0x8ECF  # Prophesee's event compression, in no plugin package; decoded in `ecf.py`
SAMPLED_ROWS = 4096  # times looked at, first and last, to tell seconds from microseconds
TIME_UNIT_NAMES = ("time_unit", "time_units", "unit", "units")
TRIGGERS = "EXT_TRIGGER/events"


class Hdf5Reader(FormatReader):
    """Reader of one HDF5 recording."""

    seeks = True
    takes = ("dataset", "time_unit")

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        super().__init__(path, options)
        with file_errors(path, "HDF5"), h5py.File(path, "r") as file:
            self._layout = find_layout(file, options.dataset, path, self.warnings)
            table = Hdf5Table(file, self._layout, path)
            self.format, self.events = self._layout.format, table.rows
            self.attributes = _attributes(file, file.attrs)
            self.stated = _stated_sensor(table.attribute_places, path, self.warnings)
            self.t_offset_us = _t_offset_us(file, path)
            first = table.rows_of(0, min(SAMPLED_ROWS, table.rows))["t"]
            last = table.rows_of(max(table.rows - SAMPLED_ROWS, 0), table.rows)["t"]
            unit = _stated_unit(file, table)
        self._types = ColumnTypes(path, options, unit, np.concatenate([first, last]), table.rows)
        self.warnings += self._types.warnings
        self.time_doubt = self._types.time_doubt

    def columns(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield the events."""
        with file_errors(self.path, "HDF5"), h5py.File(self.path, "r") as file:
            table = Hdf5Table(file, self._layout, self.path)
            if TRIGGERS in file:
                reading.triggers.append(_triggers(own_dataset(file[TRIGGERS], self.path)))
            first = 0 if reading.place is None else reading.place.offset
            reading.first_row = first
            for row in range(first, table.rows, reading.max_events):
                upto = min(row + reading.max_events, table.rows)
                block = self._types.columns(row, **table.rows_of(row, upto), damage=reading.damage)
                reading.place = Place(upto)
                if len(block):
                    yield block
                reading.report(upto - first, table.rows - first)
                if len(block) and reading.is_past(int(block.t_us[-1])):
                    return

    def truth(self) -> Truth | None:
        """Read the group /truth, None without it."""
        with file_errors(self.path, "HDF5"), h5py.File(self.path, "r") as file:
            if "truth" not in file:
                return None
            return _truth(file["truth"], self.events or 0, self.path)


class RowDataset:
    """Dataset whose rows are events: (n,), or (n, width) or (width, n), as MATLAB writes it."""

    def __init__(self, data: h5py.Dataset, width: int) -> None:
        self.data = data
        self._across = data.ndim == 2 and data.shape[0] == width != data.shape[1]
        self.fits = data.ndim == 1 or (data.ndim == 2 and width in data.shape)
        self.rows = int(data.shape[self._across]) if self.fits else 0

    def read(self, first: int, upto: int) -> NDArray[Any]:
        """Read rows [first, upto): (n,), or (n, width) of a table."""
        block: NDArray[Any] = self.data[:, first:upto].T if self._across else self.data[first:upto]
        return block.reshape(-1) if block.shape[1:] == (1,) else block


class Hdf5Table:
    """Event rows of an open file, checked for being all there and readable; raises RecordingError otherwise."""

    def __init__(self, file: h5py.File, layout: EventLayout, path: Path) -> None:
        self._path = path
        is_table = layout.columns is None
        places = layout.columns or {c: ColumnPlace(layout.path, k) for k, c in enumerate("txyp")}
        width = TABLE_COLUMNS if is_table else 1
        self._sets = {name: RowDataset(file[name], width) for name in {at.dataset: None for at in places.values()}}
        if len({rows.rows for rows in self._sets.values()}) > 1 or not all(rows.fits for rows in self._sets.values()):
            listed = ", ".join(f"{c} {file[at.dataset].shape}" for c, at in places.items())
            raise RecordingError(f"event columns differ in length ({listed}): export the recording again: {path}")
        self.rows = next(iter(self._sets.values())).rows
        self._ecf: EcfRows | None = None
        for rows in self._sets.values():
            self._check_storage(rows.data)
        self._columns = self._told_apart(layout) if is_table else places
        types = {c: (self._sets[at.dataset].data.dtype, at.part) for c, at in self._columns.items()}
        check_types(path, {c: dtype[part] if isinstance(part, str) else dtype for c, (dtype, part) in types.items()})
        # Root, events, and the group that they lie in.
        self.attribute_places = [file, file[layout.path], file[layout.path].parent]
        self.times = self._columns["t"]

    def rows_of(self, first: int, upto: int) -> dict[str, NDArray[Any]]:
        """Read t, x, y and p of rows [first, upto), in the types of the file."""
        if self._ecf is not None:
            return dict(zip("txyp", self._ecf.rows_of(first, upto), strict=True))
        blocks = {name: rows.read(first, upto) for name, rows in self._sets.items()}
        return {c: _part(blocks[at.dataset], at.part) for c, at in self._columns.items()}

    def _told_apart(self, layout: EventLayout) -> dict[str, ColumnPlace]:
        """Places of the columns of a table, told from the values in its first rows."""
        order = column_order(self._sets[layout.path].read(0, min(SAMPLED_ROWS, self.rows)))
        if order is None:
            raise RecordingError(
                f"columns of {layout.path} cannot be told apart, one of times in order and one of polarities are "
                f"needed: export t, x, y and p under their names: {self._path}"
            )
        return {c: ColumnPlace(layout.path, k) for c, k in order.items()}

    def _check_storage(self, data: h5py.Dataset) -> None:
        """Refuse other files, missing blocks (HDF5 would read zeros), decompression bombs, and unknown filters."""
        own_dataset(data, self._path)
        unpacked = data.size * data.dtype.itemsize
        if data.chunks is not None:
            chunks = prod(-(-size // chunk) for size, chunk in zip(data.shape, data.chunks, strict=True))
            present = data.id.get_num_chunks()
            if present < chunks:
                raise RecordingError(
                    f"only {present} of {chunks} blocks of {data.name} are in the file, the rest was lost: "
                    f"copy or export it again: {self._path}"
                )
            if self._undo_filters(data):
                return
        elif data.id.get_storage_size() < unpacked:
            raise RecordingError(f"{data.name} is not all in the file: copy or export it again: {self._path}")
        check_expansion(data.id.get_storage_size(), unpacked, self._path)

    def _undo_filters(self, data: h5py.Dataset) -> bool:
        """Check that the filters can be undone; True if they are Prophesee's, undone by `EcfRows`."""
        filters = data.id.get_create_plist()
        codes = [filters.get_filter(i)[0] for i in range(filters.get_nfilters())]
        if codes == [ECF_FILTER] and data.dtype.names:
            with without_time_limit():
                from .ecf import EcfRows  # compiles a decoder

            self._ecf = EcfRows(data, self._path)
            return True
        missing = [code for code in codes if not h5py.h5z.filter_avail(code)]
        if missing:
            with without_time_limit():
                import hdf5plugin  # noqa: F401  registers blosc, zstd and more; 0.1 s to load

            missing = [code for code in missing if not h5py.h5z.filter_avail(code)]
        if missing:
            raise RecordingError(
                f"{data.name} is compressed with HDF5 filter {missing[0]}, which is not known here: "
                f"repack it with gzip (h5repack -f GZIP=4 IN OUT): {self._path}"
            )
        return False


def _part(block: NDArray[Any], part: str | int | None) -> NDArray[Any]:
    """A field of records, a column of a table, or all of a column."""
    if part is None:
        return block
    return np.ascontiguousarray(block[part] if isinstance(part, str) else block[:, part])


def _attributes(place: h5py.HLObject, names: Iterable[str]) -> dict[str, str | float]:
    """Attributes of these names: numbers and texts as they are, short lists of numbers as "1,2,3"; no others."""
    found: dict[str, str | float] = {}
    for name in names:
        value = place.attrs[name]
        if isinstance(value, np.ndarray) and value.size == 1:
            value = value.reshape(-1)[0]
        if isinstance(value, bytes):
            value = value.decode("utf-8", "replace")
        if isinstance(value, np.generic):
            value = value.item()
        if isinstance(value, np.ndarray) and value.ndim == 1 and value.size <= 16 and value.dtype.kind in "iuf":
            value = ",".join(str(item) for item in value.tolist())
        if isinstance(value, (str, float, int)):
            found[name] = value
    return found


def _stated_sensor(places: list[h5py.HLObject], path: Path, warnings: list[str]) -> Resolution | None:
    for place in places:
        attributes = _attributes(
            place, [name for name in ("width", "height", "geometry", "sensor_resolution") if name in place.attrs]
        )
        if "width" in attributes and "height" in attributes:
            return resolution_or_none(attributes["width"], attributes["height"], warnings)
        if "geometry" in attributes:
            return geometry_or_none(str(attributes["geometry"]), warnings)
        if "sensor_resolution" in attributes:  # rows before columns, as event_utils and its like write it
            height, _, width = str(attributes["sensor_resolution"]).partition(",")
            return resolution_or_none(width, height, warnings)
        size = place.get("calib/resolution") if isinstance(place, h5py.Group) else None
        if isinstance(size, h5py.Dataset) and size.shape == (2,):  # M3ED
            width, height = own_dataset(size, path)[:].tolist()
            return resolution_or_none(width, height, warnings)
    return None


def _stated_unit(file: h5py.File, table: Hdf5Table) -> str | None:
    """Unit of the times by the name of their column, or by attributes of it, of the events or of the file."""
    place = table.times
    name = place.part if isinstance(place.part, str) else place.dataset.rpartition("/")[2]
    words = [
        _attributes(item, [name])[name]
        for item in (file[place.dataset], *table.attribute_places)
        for name in TIME_UNIT_NAMES
        if name in item.attrs
    ]
    return split_unit(name)[1] or next((unit for word in words if (unit := unit_of(word))), None)


def _t_offset_us(file: h5py.File, path: Path) -> int | None:
    item = file.get("t_offset")
    if not isinstance(item, h5py.Dataset) or item.size != 1:
        return None
    return int(np.asarray(own_dataset(item, path)[()]).reshape(-1)[0])


def _triggers(data: h5py.Dataset) -> Triggers:
    records = data[:]
    return Triggers(records["t"].astype(np.int64), (records["p"] == 1).astype(np.uint8), records["id"].astype(np.uint8))


def _truth(group: h5py.Group, events: int, path: Path) -> Truth:
    columns = {name: own_dataset(group[name], path)[:] for name in Truth.__slots__}
    label, rows = columns.pop("label"), columns["t_us"].size
    vectors = ("position_m", "velocity_m_s", "spin_rps")
    if any(column.shape != ((rows, 3) if name in vectors else (rows,)) for name, column in columns.items()):
        raise RecordingError(f"/truth has columns of different lengths: simulate the recording again: {path}")
    if label.shape != (events,):
        raise RecordingError(
            f"/truth/label has shape {label.shape} for {events} events: simulate the recording again: {path}"
        )
    t_us = columns.pop("t_us").astype(np.int64)
    floats = {name: column.astype(np.float64) for name, column in columns.items()}
    return Truth(t_us=t_us, label=label.astype(np.uint8), **floats)
