"""Reader of HDF5 recordings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ....errors import RecordingError
from ....isolation import without_time_limit
from ....results import Truth
from ...column_types import ColumnTypes, check_expansion, check_types, named_columns
from ...reader import MAX_DISORDER_US, FormatReader, Place, ReadPass, Triggers, UncheckedEvents, file_errors
from ...sensor import Resolution, geometry_or_none, resolution_or_none
from .storage import own_dataset

if TYPE_CHECKING:
    from .ecf import EcfRows

ECF_FILTER = 0x8ECF  # Prophesee's event compression, in no plugin package; decoded in `ecf.py`
SAMPLED_ROWS = 4096  # times looked at, first and last, to tell seconds from microseconds
COMPOUNDS = ("CD/events", "events")
TRIGGERS = "EXT_TRIGGER/events"


class Hdf5Reader(FormatReader):
    """Reader of one HDF5 recording."""

    seeks = True

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with file_errors(path, "HDF5"), h5py.File(path, "r") as file:
            table = Hdf5Table(file, path)
            self.format, self.events = table.format, table.rows
            self.attributes = _attributes(file, file.attrs)
            self.stated = _stated_sensor(table.attribute_places, self.warnings)
            self.t_offset_us = _t_offset_us(file, path)
            first = table.rows_of(0, min(SAMPLED_ROWS, table.rows))[0]
            last = table.rows_of(max(table.rows - SAMPLED_ROWS, 0), table.rows)[0]
        self._types = ColumnTypes(path, np.concatenate([first, last]))
        if self._types.warning:
            self.warnings.append(self._types.warning)

    def columns(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield the events."""
        with file_errors(self.path, "HDF5"), h5py.File(self.path, "r") as file:
            table = Hdf5Table(file, self.path)
            if TRIGGERS in file:
                reading.triggers.append(_triggers(own_dataset(file[TRIGGERS], self.path)))
            first = 0 if reading.place is None else reading.place.offset
            reading.first_row = first
            for row in range(first, table.rows, reading.max_events):
                upto = min(row + reading.max_events, table.rows)
                block = self._types.columns(row, *table.rows_of(row, upto))
                reading.place = Place(upto)
                yield block
                reading.report(upto - first, table.rows - first)
                if reading.is_past(int(block.t_us[-1])):
                    return

    def truth(self) -> Truth | None:
        """Read the group /truth, None without it."""
        with file_errors(self.path, "HDF5"), h5py.File(self.path, "r") as file:
            if "truth" not in file:
                return None
            return _truth(file["truth"], self.events or 0, self.path)

    def place_before(self, start_us: int) -> Place | None:
        """Find the place by bisection, close to the first event that is not earlier."""
        with file_errors(self.path, "HDF5"), h5py.File(self.path, "r") as file:
            table = Hdf5Table(file, self.path)
            low, high = 0, table.rows  # invariant: all rows before low are early
            while high - low > 1:
                middle = (low + high) // 2
                t_us = self._types.columns(middle, *table.rows_of(middle, middle + 1)).t_us
                # Later events may be up to 10 ms earlier than this one, earlier events up to 10 ms later.
                if int(t_us[0]) + MAX_DISORDER_US < start_us:
                    low = middle
                else:
                    high = middle
            return Place(low)


class Hdf5Table:
    """Event rows of an open file, checked for being all there and readable; raises RecordingError otherwise."""

    def __init__(self, file: h5py.File, path: Path) -> None:
        self._path = path
        self.format, self._place, self._names, self._compound = _layout(file, path)
        place = file[self._place]
        self._sets = {self._place: place} if self._compound else {c: place[n] for c, n in self._names.items()}
        shapes = {name: data.shape for name, data in self._sets.items()}
        if len(set(shapes.values())) > 1 or any(len(shape) != 1 for shape in shapes.values()):
            listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
            raise RecordingError(f"event columns differ in length ({listed}): export the recording again: {path}")
        self.rows = int(next(iter(shapes.values()))[0])
        check_types(path, {c: place.dtype[n] if self._compound else place[n].dtype for c, n in self._names.items()})
        # Root, events, and the group that they lie in.
        self.attribute_places = [file, place, place.parent]
        self._ecf: EcfRows | None = None
        for data in self._sets.values():
            self._check_storage(data)

    def rows_of(self, first: int, upto: int) -> tuple[NDArray[Any], ...]:
        """Read t, x, y and p of rows [first, upto), in the types of the file."""
        if self._ecf is not None:
            return self._ecf.rows_of(first, upto)
        if not self._compound:
            return tuple(self._sets[c][first:upto] for c in "txyp")
        records = self._sets[self._place][first:upto]
        return tuple(np.ascontiguousarray(records[self._names[c]]) for c in "txyp")

    def _check_storage(self, data: h5py.Dataset) -> None:
        """Refuse other files, missing blocks (HDF5 would read zeros), decompression bombs, and unknown filters."""
        own_dataset(data, self._path)
        unpacked = self.rows * data.dtype.itemsize
        if data.chunks is not None:
            chunks = -(-self.rows // data.chunks[0])
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
        if codes == [ECF_FILTER] and self._compound:
            with without_time_limit():
                from .ecf import EcfRows

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


def _layout(file: h5py.File, path: Path) -> tuple[str, str, dict[str, str], bool]:
    """Find the events in a file.

    Returns
    -------
    format : str
        Name of the layout for people.
    place : str
        Path of the compound dataset, or of the group of the columns.
    names : dict of str to str
        Field or dataset of t, x, y and p.
    compound : bool
        Whether the events are one dataset of records.
    """
    for place in COMPOUNDS:
        item = file.get(place)
        if isinstance(item, h5py.Dataset) and item.dtype.names:
            names = named_columns(item.dtype.names)
            if names is not None:
                maker = "Prophesee HDF5" if place.startswith("CD") else "HDF5"
                return f"{maker} compound", place, names, True
    for place in ("events", "/"):
        item = file.get(place)
        if isinstance(item, h5py.Group):
            names = named_columns(n for n in item if isinstance(item.get(n), h5py.Dataset))
            if names is not None:
                return "HDF5 columns", place, names, False
    present = ", ".join(sorted(file)[:8]) or "nothing"
    raise RecordingError(
        f"HDF5 file holds no events (it has {present}): /CD/events or /events/x, y, t, p needed: {path}"
    )


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


def _stated_sensor(places: list[h5py.HLObject], warnings: list[str]) -> Resolution | None:
    for place in places:
        attributes = _attributes(place, [name for name in ("width", "height", "geometry") if name in place.attrs])
        if "width" in attributes and "height" in attributes:
            return resolution_or_none(attributes["width"], attributes["height"], warnings)
        if "geometry" in attributes:
            return geometry_or_none(str(attributes["geometry"]), warnings)
    return None


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
