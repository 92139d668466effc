"""Reader of HDF5 recordings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ....errors import RecordingError
from ....results import Truth
from ...column_types import ColumnTypes, check_expansion, check_types, named_columns
from ...reader import MAX_DISORDER_US, FormatReader, ReadPass, Triggers, UncheckedEvents, file_errors
from ...sensor import Resolution, geometry_or_none, resolution_or_none
from .heap import check_heap

ECF_FILTER = 0x8ECF  # Prophesee's event compression, in no plugin package; decoded in `ecf.py`
SAMPLED_ROWS = 4096  # times looked at, first and last, to tell seconds from microseconds
COMPOUNDS = ("CD/events", "events")
TRIGGERS = "EXT_TRIGGER/events"


class Hdf5Reader(FormatReader):
    """Reader of one HDF5 recording."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with file_errors(path, "HDF5"), h5py.File(path, "r") as file:
            self._layout = Hdf5Layout.found(file, path)
            self.format = self._layout.format
            if any(_has_texts(file[place]) for place in self._layout.attribute_places):
                check_heap(path)
            self.attributes = _attributes(file)
            self.stated = _stated_sensor(file, self._layout, self.warnings)
            self.t_offset_us = _t_offset_us(file)
            table = Hdf5Table(file, self._layout, path)
            self.events = table.rows
            first = table.times_of(0, min(SAMPLED_ROWS, table.rows))
            last = table.times_of(max(table.rows - SAMPLED_ROWS, 0), table.rows)
        self._types = ColumnTypes(path, first.dtype, np.concatenate([first, last]))
        if self._types.warning:
            self.warnings.append(self._types.warning)

    def columns(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield the events; rows far outside the requested times are skipped by bisection."""
        with file_errors(self.path, "HDF5"), h5py.File(self.path, "r") as file:
            table = Hdf5Table(file, self._layout, self.path)
            if TRIGGERS in file:
                reading.triggers.append(_triggers(file[TRIGGERS]))
            first = 0 if reading.start_us is None else self._row_before(table, reading.start_us)
            reading.first_row = first
            for row in range(first, table.rows, reading.max_events):
                upto = min(row + reading.max_events, table.rows)
                block = self._types.columns(row, *table.rows_of(row, upto))
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

    def _row_before(self, table: Hdf5Table, start_us: int) -> int:
        """Row before which all events are earlier than start_us, close to the first that is not."""
        low, high = 0, table.rows  # invariant: all rows before low are early
        while high - low > 1:
            middle = (low + high) // 2
            t_us = self._types.columns(middle, *table.rows_of(middle, middle + 1)).t_us
            # Later events may be up to 10 ms earlier than this one, earlier events up to 10 ms later.
            if int(t_us[0]) + MAX_DISORDER_US < start_us:
                low = middle
            else:
                high = middle
        return low


@dataclass(frozen=True, slots=True)
class Hdf5Layout:
    """Place of the events in a file.

    Attributes
    ----------
    format : str
        Name of the layout for people.
    place : str
        Path of the compound dataset, or of the group of the columns.
    names : dict of str to str
        Field or dataset of t, x, y and p.
    compound : bool
        Whether the events are one dataset of records.
    """

    format: str
    place: str
    names: dict[str, str]
    compound: bool

    @property
    def attribute_places(self) -> list[str]:
        """Root, events, and the group that they lie in."""
        return list(dict.fromkeys(("/", self.place, self.place.rpartition("/")[0] or "/")))

    @classmethod
    def found(cls, file: h5py.File, path: Path) -> Hdf5Layout:
        """Find the layout of a file; raises RecordingError when it holds no events."""
        for place in COMPOUNDS:
            item = file.get(place)
            if isinstance(item, h5py.Dataset) and item.dtype.names:
                names = named_columns(item.dtype.names)
                if names is not None:
                    maker = "Prophesee HDF5" if place.startswith("CD") else "HDF5"
                    return cls(f"{maker} compound", place, names, compound=True)
        for place in ("events", "/"):
            item = file.get(place)
            if isinstance(item, h5py.Group):
                names = named_columns(n for n in item if isinstance(item.get(n), h5py.Dataset))
                if names is not None:
                    return cls("HDF5 columns", place, names, compound=False)
        present = ", ".join(sorted(file)[:8]) or "nothing"
        raise RecordingError(
            f"HDF5 file holds no events (it has {present}): /CD/events or /events/x, y, t, p needed: {path}"
        )


class Hdf5Table:
    """Event rows of an open file, checked for being all there and readable."""

    def __init__(self, file: h5py.File, layout: Hdf5Layout, path: Path) -> None:
        self._path, self._layout = path, layout
        place = file[layout.place]
        self._sets = {layout.place: place} if layout.compound else {c: place[n] for c, n in layout.names.items()}
        shapes = {name: data.shape for name, data in self._sets.items()}
        if len(set(shapes.values())) > 1 or any(len(shape) != 1 for shape in shapes.values()):
            listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
            raise RecordingError(f"event columns differ in length ({listed}): export the recording again: {path}")
        self.rows = int(next(iter(shapes.values()))[0])
        if layout.compound:
            check_types(path, {c: place.dtype[n] for c, n in layout.names.items()})
        else:
            check_types(path, {c: data.dtype for c, data in self._sets.items()})
        self._ecf: Any = None
        for data in self._sets.values():
            self._check_storage(data)

    def rows_of(self, first: int, upto: int) -> tuple[NDArray[Any], ...]:
        """Read t, x, y and p of rows [first, upto), in the types of the file."""
        if self._ecf is not None:
            columns: tuple[NDArray[Any], ...] = self._ecf.rows_of(first, upto)
            return columns
        if not self._layout.compound:
            return tuple(self._sets[c][first:upto] for c in "txyp")
        records = self._sets[self._layout.place][first:upto]
        return tuple(np.ascontiguousarray(records[self._layout.names[c]]) for c in "txyp")

    def times_of(self, first: int, upto: int) -> NDArray[Any]:
        """Read the times of rows [first, upto), in the type of the file."""
        if self._layout.compound:
            return self.rows_of(first, upto)[0]
        times: NDArray[Any] = self._sets["t"][first:upto]
        return times

    def _check_storage(self, data: h5py.Dataset) -> None:
        """Refuse missing blocks (HDF5 would read zeros), decompression bombs, and unknown filters."""
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
        elif data.id.get_storage_size() < unpacked and data.external is None:
            raise RecordingError(f"{data.name} is not all in the file: copy or export it again: {self._path}")
        check_expansion(data.id.get_storage_size(), unpacked, self._path)

    def _undo_filters(self, data: h5py.Dataset) -> bool:
        """Check that the filters can be undone; True if they are Prophesee's, undone by `EcfRows`."""
        filters = data.id.get_create_plist()
        codes = [filters.get_filter(i)[0] for i in range(filters.get_nfilters())]
        if codes == [ECF_FILTER] and self._layout.compound:
            from .ecf import EcfRows  # compiles a decoder

            self._ecf = EcfRows(data, self._path)
            return True
        missing = [code for code in codes if not h5py.h5z.filter_avail(code)]
        if missing:
            import hdf5plugin  # noqa: F401  registers blosc, zstd and more; 0.1 s to load

            missing = [code for code in missing if not h5py.h5z.filter_avail(code)]
        if missing:
            raise RecordingError(
                f"{data.name} is compressed with HDF5 filter {missing[0]}, which is not known here: "
                f"repack it with gzip (h5repack -f GZIP=4 IN OUT): {self._path}"
            )
        return False


def _attributes(file: h5py.File) -> dict[str, str | float]:
    """Root attributes: numbers and texts as they are, short lists of numbers as "1,2,3"; no others."""
    found: dict[str, str | float] = {}
    for name in file.attrs:
        value = file.attrs[name]
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


def _stated_sensor(file: h5py.File, layout: Hdf5Layout, warnings: list[str]) -> Resolution | None:
    for place in layout.attribute_places:
        attributes = file[place].attrs
        if "width" in attributes and "height" in attributes:
            return resolution_or_none(_scalar(attributes["width"]), _scalar(attributes["height"]), warnings)
        if "geometry" in attributes:
            text = _scalar(attributes["geometry"])
            text = text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text)
            return geometry_or_none(text, warnings)
    return None


def _has_texts(place: h5py.Group | h5py.Dataset) -> bool:
    """Whether there are attributes of variable length, which HDF5 looks up in its heap."""
    attributes = place.attrs
    return any(h5py.check_dtype(vlen=attributes.get_id(name).dtype) is not None for name in attributes)


def _scalar(value: object) -> object:
    return value.reshape(-1)[0] if isinstance(value, np.ndarray) and value.size == 1 else value


def _t_offset_us(file: h5py.File) -> int | None:
    item = file.get("t_offset")
    if not isinstance(item, h5py.Dataset) or item.size != 1:
        return None
    return int(np.asarray(item[()]).reshape(-1)[0])


def _triggers(data: h5py.Dataset) -> Triggers:
    records = data[:]
    return Triggers(records["t"].astype(np.int64), (records["p"] == 1).astype(np.uint8), records["id"].astype(np.uint8))


def _truth(group: h5py.Group, events: int, path: Path) -> Truth:
    columns = {name: group[name][:] for name in ("t_us", "x_px", "y_px", "radius_px")}
    vectors = {name: group[name][:] for name in ("position_m", "velocity_m_s", "spin_rps")}
    label = group["label"][:]
    rows = columns["t_us"].size
    if any(c.shape != (rows,) for c in columns.values()) or any(v.shape != (rows, 3) for v in vectors.values()):
        raise RecordingError(f"/truth has columns of different lengths: simulate the recording again: {path}")
    if label.shape != (events,):
        raise RecordingError(
            f"/truth/label has shape {label.shape} for {events} events: simulate the recording again: {path}"
        )
    t_us = columns.pop("t_us").astype(np.int64)
    floats = {name: c.astype(np.float64) for name, c in {**columns, **vectors}.items()}
    return Truth(t_us=t_us, label=label.astype(np.uint8), **floats)
